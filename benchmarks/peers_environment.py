"""An environment for each peer, since what one asks for does not belong beside another's, nor beside ours.

It lies below `.cache/peers`, is made on first use from the pins in a .txt beside the peer's script, and is entered by a
subprocess alone.
"""

import fcntl
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

FOLDER = Path(__file__).resolve().parents[1] / ".cache" / "peers"
BUILD = Path(__file__).resolve().parent / "peers" / "build.txt"


def python_of(peer, wheels=None) -> Path:
    """A Python that can run the script `peer`; makes its environment if there is none yet. Without pins: this Python.

    The stamp is written last and holds all that the environment depends on. One that was left half-made, or made from
    other pins or by another Python, is thus thrown away and made again. A lock keeps parallel processes from making it
    twice; pip and venv inherit it, so that it also holds while one of them outlives a killed process.

    Args:
        peer: path of its script.
        wheels: a folder of all wheels, for a machine without network.

    Raises:
        RuntimeError: it cannot be made, with the stderr of what failed.
    """
    pins = Path(peer).with_suffix(".txt")
    if not pins.exists():
        return Path(sys.executable)
    folder = FOLDER / pins.stem
    python, stamp = folder / "bin" / "python", folder / "stamp.json"
    wanted = json.dumps([sys.version_info[:2], BUILD.read_text(), pins.read_text()])

    FOLDER.mkdir(parents=True, exist_ok=True)
    with open(folder.with_suffix(".lock"), "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        os.set_inheritable(lock.fileno(), True)
        if python.exists() and stamp.exists() and stamp.read_text() == wanted:
            return python
        if folder.exists():
            shutil.rmtree(folder)
        # No dependencies: the pins are all there is.
        pip = [python, "-I", "-m", "pip", "--disable-pip-version-check", "install", "--no-deps"]
        pip += [] if wheels is None else ["--no-index", "--find-links", wheels]
        run([sys.executable, "-I", "-m", "venv", folder], timeout=300)
        run([*pip, "-r", BUILD], timeout=600)
        run([*pip, "--no-build-isolation", "-r", pins], timeout=1200)
        stamp.write_text(wanted)
    return python


def run(command, timeout):
    """Runs `command`; the Pythons among them with `-I`, so that a PYTHONPATH meant for others does not reach them.

    Raises:
        RuntimeError: it failed, or takes longer than `timeout` seconds, with its stderr; the last line says most.
    """
    shown = " ".join(map(str, command))
    try:
        done = subprocess.run(
            command, stdin=subprocess.DEVNULL, capture_output=True, timeout=timeout, close_fds=False, check=False
        )
    except subprocess.TimeoutExpired as error:
        stderr = (error.stderr or b"").decode(errors="replace")
        raise RuntimeError(f"{shown}\n{stderr}\nnot done after {timeout:g} s") from error
    if done.returncode:
        status = f"exit status {done.returncode}"
        stderr = done.stderr.decode(errors="replace").strip() or status
        raise RuntimeError(f"{shown}: {status}\n{stderr}")
