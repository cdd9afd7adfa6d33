"""What several commands make of their arguments."""

from pathlib import Path

from ..errors import ParameterError


def writable(option, path, suffixes):
    """`path`, which has one of these suffixes, in a directory that is there."""
    path = Path(path)
    if path.suffix not in suffixes:
        raise ParameterError(f"{option} must end in {' or '.join(suffixes)}, got {str(path)!r}")
    if not path.parent.is_dir():
        raise ParameterError(f"{option} is in {str(path.parent)!r}, which is not a directory")
    return path


def numbers(option, text):
    """ "r,g,b" as numbers; how many there may be is for the library to say."""
    try:
        found = [float(part) for part in text.split(",")]
    except ValueError:
        raise ParameterError(f"{option} must be numbers such as 1,1,1, got {text!r}") from None
    return found[0] if len(found) == 1 else found
