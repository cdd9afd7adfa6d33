"""What several commands make of their arguments."""

from pathlib import Path

import abuffer as ab

from .. import _check, scenes

SUITES = (*scenes.NEWEST, *scenes.VERSIONS)
SCENES = {make.__name__: make for make in (*scenes.VERSIONS[scenes.NEWEST["standard"]], scenes.model)}


def writable(option, path, suffixes):
    """`path`, which has one of these suffixes, in a directory that is there."""
    path = Path(path)
    if path.suffix not in suffixes:
        raise ab.ParameterError(f"{option} must end in {' or '.join(suffixes)}, got {str(path)!r}")
    if not path.parent.is_dir():
        raise ab.ParameterError(f"{option} is in {str(path.parent)!r}, which is not a directory")
    return path


def numbers(option, text):
    """ "r,g,b" as numbers; how many there may be is for the library to say."""
    try:
        found = [float(part) for part in text.split(",")]
    except ValueError:
        raise ab.ParameterError(f"{option} must be numbers such as 1,1,1, got {text!r}") from None
    return found[0] if len(found) == 1 else found


def add_models(parser):
    """Options of models that are read from files; standard scenes are as they are."""
    parser.add_argument("--alpha", type=float, metavar="A", help="multiplies the alpha of models from files, 0 to 1")
    parser.add_argument("--shade", action="store_true", help="Lambert shading of models from files")


def add_size(parser):
    parser.add_argument("--width", type=int, metavar="PIXELS", help="with --height (default: 640x480)")
    parser.add_argument("--height", type=int, metavar="PIXELS")


def scenes_of(word, given, suites=()) -> dict:
    """Scenes by name: those of one of these suites, a standard scene, or the model in a file.

    Args:
        given: has the options of `add_models`.
    """
    if word in suites:
        return scenes.suite(word)
    if word in SCENES:
        return {word: SCENES[word]()}
    path = Path(word)
    if not path.suffix:  # no file: those say their format by one
        _check.choice("a model that is no file", word, (*suites, *SCENES))
    scene = ab.Scene()
    scene.add(word, alpha=given.alpha, shade=given.shade)
    return {path.stem: scene}
