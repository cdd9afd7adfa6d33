"""What images are compared with: exact in float64, or an image that a user gives."""

from dataclasses import replace

import numpy as np

from ..errors import ParameterError
from ..frame import Frame
from ..render import render

# What may be said in place of an image.
COMPUTED = ("float64", "fragments")


def exact_of(subject, size, most_fragments, reference):
    """The exact frame, float64, with its lists if they are not more than `most_fragments`.

    Args:
        reference: "fragments": float64 composites what float32 rasterises, as all methods do, so that errors are of compositing
            alone. Else all of it is in float64.
    """
    arguments = {"width": size[0], "height": size[1], "background": subject.background, "device": "cpu"}
    if isinstance(reference, str) and reference == "fragments":
        frame = render(subject.scene, subject.camera, **arguments, fragments=True)
        kept = frame.fragments if len(frame.fragments) <= most_fragments else None
        return replace(frame, image=frame.fragments.composite(), fragments=kept)
    arguments["precision"] = "float64"
    frame = render(subject.scene, subject.camera, **arguments, fragments="count")
    if frame.stats.fragments <= most_fragments:
        frame = render(subject.scene, subject.camera, **arguments, fragments=True)
    return frame


def given(reference, subjects, sizes) -> dict:
    """Images by scene that a user gives as reference, (H, W, 4) float64; {} where it is computed.

    Raises:
        ParameterError: one is missing, of another size, no floats, or not finite.
    """
    if isinstance(reference, str) and reference in COMPUTED:
        return {}
    names = [subject.name for subject in subjects]
    if not isinstance(reference, dict):
        if len(names) > 1:
            raise ParameterError(f"reference is one image, and there are {len(names)} scenes: give a dict by name")
        reference = {names[0]: reference}
    reference = {str(name): image for name, image in reference.items()}
    missing = [name for name in names if name not in reference]
    if missing:
        raise ParameterError(f"reference has no image of {', '.join(missing)}: it has {', '.join(reference)}")
    return {name: _reference(name, reference[name], sizes[name]) for name in names}


def _reference(name, reference, size):
    what = f"reference of {name}"
    if isinstance(reference, str):
        raise ParameterError(
            f"{what} must be an image, got {reference!r}: {' and '.join(map(repr, COMPUTED))} are for all scenes, in place of a dict"
        )
    image = linear_image(what, reference, size)
    bad = int((~np.isfinite(image)).any(axis=2).sum())
    if bad:
        raise ParameterError(f"{what} is not finite in {bad:,} pixels: nothing can be compared with them")
    return image.astype(np.float64)


def linear_image(what, image, size):
    """An image that a user gives, or a Frame's: (H, W, 4) floats, premultiplied.

    Args:
        what: it is, for errors.
        size: (width, height).
    """
    try:
        image = np.asarray(image.image if isinstance(image, Frame) else image)
    except ValueError as e:
        raise ParameterError(f"{what} is no array: {e}") from e
    width, height = size
    if image.shape != (height, width, 4):
        raise ParameterError(f"{what} must be an image of {height}×{width}×4, premultiplied, got {image.shape}")
    if image.dtype.kind != "f":
        raise ParameterError(f"{what} must be of floats, premultiplied and linear, got {image.dtype}: divide by 255")
    return image
