"""Standard scenes: small, reproducible, each hard for something. `suite` has them under a named version, for papers.

>>> from abuffer import render
>>> s = intersecting()
>>> frame = render(s.scene, s.camera, width=64, height=48, background=s.background, device="cpu", fragments="count")
>>> int(frame.counts.max()), s.hard_for
(3, 'sorting triangles or objects: where two pass through each other no order of them is right')
"""

from .. import _check
from .bodies import hair, hdr_lights, nested_spheres, opaque_and_glass, random_triangles, smoke
from .planes import coplanar, cyclic, intersecting, stack, thin_sheets
from .scanned import model
from .standard import StandardScene

__all__ = [
    "StandardScene",
    "Suite",
    "coplanar",
    "cyclic",
    "hair",
    "hdr_lights",
    "intersecting",
    "model",
    "nested_spheres",
    "opaque_and_glass",
    "random_triangles",
    "smoke",
    "stack",
    "suite",
    "thin_sheets",
]

# What a version holds never changes: a scene that should be another goes into the next one.
VERSIONS = {
    "standard-1": (
        stack,
        intersecting,
        cyclic,
        coplanar,
        nested_spheres,
        random_triangles,
        thin_sheets,
        opaque_and_glass,
        hair,
        smoke,
        hdr_lights,
    )
}
NEWEST = {"standard": "standard-1"}


class Suite(dict):
    """StandardScenes by name, in a fixed order, and the `version` to cite."""

    def __init__(self, version, scenes):
        super().__init__({each.name: each for each in scenes})
        self.version = version

    def __repr__(self):
        return f"Suite({self.version!r}: {', '.join(self)})"


def suite(name="standard") -> Suite:
    """The scenes that images and numbers of papers are made of: all with their defaults, the same triangles for everybody.

    `model` is not among them, since its file is another package's.

    Args:
        name: "standard", the newest version, or a version, such as "standard-1", which stays as it is.

    Raises:
        ParameterError: there is no suite of that name: lists those that there are.

    >>> scenes = suite("standard")
    >>> scenes.version, len(scenes), scenes["hair"]
    ('standard-1', 11, StandardScene('hair', 96,000 triangles))
    """
    name = _check.choice("name", name, (*NEWEST, *VERSIONS))
    version = NEWEST.get(name, name)
    return Suite(version, [make() for make in VERSIONS[version]])
