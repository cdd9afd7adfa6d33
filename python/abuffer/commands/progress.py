"""What is shown on stderr of work that goes on."""

import contextlib
import threading

LONG = 1.0  # seconds after which work says that it is going on


@contextlib.contextmanager
def status(text):
    """Shows `text` on a terminal while the block runs long; nothing without rich, or if it is short."""
    try:
        from rich.console import Console
    except ImportError:
        yield
        return
    console = Console(stderr=True)
    if not console.is_terminal:
        yield
        return
    shown = console.status(f"{text} …")
    timer = threading.Timer(LONG, shown.start)
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        timer.join()  # else it might start after the stop
        shown.stop()
