"""What methods are compared on: scenes with a name, a camera and a background."""

from dataclasses import dataclass

from ..camera import Camera
from ..errors import ParameterError
from ..mesh import Mesh
from ..scene import Scene, as_scene

NOTHING = (0, 0, 0, 0)


@dataclass(frozen=True)
class Subject:
    name: str
    scene: Scene
    camera: Camera
    background: object = NOTHING


def subjects(scenes, camera, background=None) -> list:
    """A Subject for each of `scenes`.

    Args:
        scenes: a scene, or anything that `Scene.add` takes; what has a `scene` and a `camera` of its own, and perhaps a `name` and
            a `background`, such as a standard scene; a list of such; or a dict of them by name.
        camera: of scenes that have none. None: `Camera.fit`.
        background: of scenes that have none, as in `render`. None: transparent.

    Raises:
        SceneError: something is no scene. ParameterError: there is none, or two have one name.
    """
    background = NOTHING if background is None else background
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
    return [_subject(name, scene, camera, background) for name, (_, scene) in zip(names, named, strict=True)]


def _is_list(scenes):
    """Of scenes: not of meshes or files, which are one scene, as `Scene.add` takes them."""
    return isinstance(scenes, list | tuple) and any(_is_standard(scene) or isinstance(scene, Scene) for scene in scenes)


def _is_standard(scene):
    return hasattr(scene, "scene") and hasattr(scene, "camera") and not isinstance(scene, Mesh)


def _subject(name, scene, camera, background):
    if _is_standard(scene):
        background = getattr(scene, "background", background)
        scene, camera = scene.scene, scene.camera
    own = Scene(as_scene(scene))
    camera = Camera.fit(own) if camera is None else camera
    if not isinstance(camera, Camera):
        raise ParameterError(f"the camera of {name} must be an abuffer.Camera, got {type(camera).__name__}")
    return Subject(name, own, camera, background)
