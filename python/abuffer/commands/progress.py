"""What is shown on stderr of work that goes on."""

import contextlib
import sys
import threading
import time

LONG = 1.0  # seconds after which work says that it is going on
EVERY = 5.0  # seconds between lines of work that counts its steps


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


@contextlib.contextmanager
def steps():
    """Shows how far the block is, and how long it may take: a bar on a terminal, else a line now and then.

    What it gives is to be called before each step with how many are done, how many there are, and what comes.
    """
    bar = _bar()
    if bar is None:
        yield _lines()
        return
    with bar:
        task = bar.add_task("")
        yield lambda done, all, what: bar.update(task, completed=done, total=all, description=what)


def _bar():
    """None without rich, or where stderr is no terminal."""
    try:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
    except ImportError:
        return None
    console = Console(stderr=True)
    if not console.is_terminal:
        return None
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
    return Progress(*columns, console=console, transient=True)


def _lines():
    start = time.monotonic()
    next_line = start

    def step(done, all, what):
        nonlocal next_line
        now = time.monotonic()
        if now < next_line:
            return
        next_line = now + EVERY
        left = f", about {(now - start) / done * (all - done):.0f} s left" if done else ""
        print(f"abuffer: {what} ({done} of {all} steps{left})", file=sys.stderr, flush=True)

    return step
