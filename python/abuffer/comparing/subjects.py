"""What methods are compared on: scenes with a name, a camera and a background."""

from dataclasses import dataclass

import numpy as np

from ..camera import Camera
from ..errors import ParameterError
from ..mesh import Mesh
from ..scene import Scene, as_scene


@dataclass(frozen=True)
class Subject:
    name: str
    scene: Scene
    camera: Camera
    background: object = (0, 0, 0, 0)


def subjects(scenes, camera) -> list:
    """A Subject for each of `scenes`.

    Args:
        scenes: a scene, or anything that `Scene.add` takes; what has a `scene` and a `camera` of its own, and perhaps a `name` and
            a `background`, such as a standard scene; a list of such; or a dict of them by name.
        camera: of scenes that have none. None: `Camera.fit`.

    Raises:
        SceneError: something is no scene. ParameterError: there is none, or two have one name.
    """
    if isinstance(scenes, dict):
        named = list(scenes.items())
    elif _is_list(scenes):
        named = [(getattr(scene, "name", None) or f"scene {i}", scene) for i, scene in enumerate(scenes, 1)]
    else:
        named = [(getattr(scenes, "name", None) or "scene", scenes)]
    names = [str(name) for name, _ in named]
    if not names:
        raise ParameterError("there is no scene to compare on")
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ParameterError(f"several scenes are named {', '.join(twice)}: give a dict of scenes by name")
    return [_subject(name, scene, camera) for name, (_, scene) in zip(names, named, strict=True)]


def _is_list(scenes):
    """Of scenes: not of meshes, which are one scene."""
    return isinstance(scenes, list | tuple) and any(_is_standard(scene) or isinstance(scene, Scene) for scene in scenes)


def _is_standard(scene):
    return hasattr(scene, "scene") and hasattr(scene, "camera") and not isinstance(scene, Mesh)


def _subject(name, scene, camera):
    if _is_standard(scene):
        return Subject(name, Scene(as_scene(scene.scene)), scene.camera, getattr(scene, "background", (0, 0, 0, 0)))
    own = Scene(as_scene(scene))
    return Subject(name, own, Camera.fit(own) if camera is None else camera)


def same_size(image, size) -> np.ndarray:
    """A reference that a user gives: (H, W, 4) float64."""
    reference = np.asarray(image, np.float64)
    width, height = size
    if reference.shape != (height, width, 4):
        raise ParameterError(f"reference must be an image of {height}×{width}×4, premultiplied, got {reference.shape}")
    return reference
