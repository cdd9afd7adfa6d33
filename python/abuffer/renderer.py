"""Scenes that stay on a device from one render to the next."""

from collections import deque

from . import _core, _methods, tables, within
from .camera import Camera
from .errors import ParameterError
from .frame import Frame
from .job import ARGUMENTS, prepared
from .options import EXACT_OPTIONS, OPTIONS
from .scene import Scene, as_scene

END = object()  # of cameras


class Renderer:
    """Renders scenes that are uploaded once, from as many cameras as there are.

    The frames are those of `render`, to the bit. On a GPU, pipeline "tiles" sends the geometry of an uploaded scene once,
    and keeps its buffers; "linked_list" and "prefix_sum" keep buffers, but bring positions to each eye on the host.

    Args:
        device: as in `render`.

    >>> from abuffer import Camera, Mesh
    >>> renderer = Renderer("cpu")
    >>> triangle = renderer.upload(Mesh([[-1, -1, 0], [1, -1, 0], [0, 1, 0]], colors=(1, 0, 0, .5)))
    >>> cameras = [Camera.look_at((x, 0, 3), (0, 0, 0)) for x in (-1, 1)]
    >>> [frame.image[24, 32].tolist() for frame in renderer.render_many(triangle, cameras, width=64, height=48)]
    [[0.5, 0.0, 0.0, 0.5], [0.5, 0.0, 0.0, 0.5]]
    """

    def __init__(self, device="auto"):
        tables.choose("auto", device, "float32", None, [])  # names the devices that there are, if this is none
        self.device = device

    def upload(self, scene) -> "UploadedScene":
        """The scene as it is now, for this renderer. What is added to `scene` later is not in it.

        Geometry goes to the device with the first frame that needs it there.

        Args:
            scene: Scene, or anything that `Scene.add` takes.

        Raises:
            SceneError: it is none of those.
        """
        return UploadedScene(self, Scene(as_scene(scene)))

    def render(self, scene, camera=None, **arguments) -> Frame:
        """A frame, like `render(scene, camera, device=..., **arguments)`.

        Args:
            scene: what `upload` returned, or a scene that is rendered once.
            arguments: those of `render`, but for `device`.
        """
        scene = self._own(scene)
        self._check(arguments)
        if arguments.get("max_error") is not None:
            return self._within(scene, camera, arguments)
        job = self._job(scene, camera, arguments)
        return job.frame(job.output(scene._upload(job.adapter)))

    def render_many(self, scene, cameras, **arguments):
        """An iterator of a frame for each camera, in their order. While one is read back a GPU renders the next.

        Only what is being rendered and read is held: any number of cameras will do. A camera is asked for one frame
        before its own comes out.

        Args:
            scene: what `upload` returned, or a scene, which is uploaded as it is now.
            cameras: an iterable of Camera.
            arguments: those of `render`, but for `device`; the same for all.

        Raises:
            ParameterError: cameras is no iterable, or an argument is none of those. What is wrong with a camera is raised
                in its turn, after the frames before it.
        """
        scene = self._own(scene)
        if isinstance(cameras, Camera):
            raise ParameterError("cameras must be an iterable of Camera, got one Camera: give [camera], or call render")
        try:
            cameras = iter(cameras)
        except TypeError:
            raise ParameterError(f"cameras must be an iterable of Camera, got {type(cameras).__name__}") from None
        self._check(arguments)
        return self._frames(scene, cameras, arguments)

    def _frames(self, scene, cameras, arguments):
        waiting = deque()  # at most one frame, beside the one that begins
        while True:
            try:
                camera = next(cameras, END)
                if camera is END:
                    break
                if camera is None:
                    raise ParameterError(
                        "cameras must be Cameras, got None: Camera.fit(scene) is what None means to render"
                    )
                waiting.append(self._begun(scene, camera, arguments))
            except Exception:
                for finish in waiting:  # frames before this one have no part in its error
                    yield finish()
                raise
            if len(waiting) > 1:
                yield waiting.popleft()()
        for finish in waiting:
            yield finish()

    def _begun(self, scene, camera, arguments):
        """A function that returns the frame of a camera, which a GPU has begun if one submission does."""
        if arguments.get("max_error") is not None:
            frame = self._within(scene, camera, arguments)
            return lambda: frame
        job = self._job(scene, camera, arguments)
        upload = scene._upload(job.adapter)
        begun = upload and job.begin(upload)
        if begun is None:
            frame = job.frame(job.output(upload))
            return lambda: frame
        return lambda: job.frame(job.finish(upload, begun))

    def _check(self, arguments):
        if "device" in arguments:
            raise ParameterError(f"device is the renderer's, {self.device!r}: make another Renderer for another device")
        method = arguments.get("method", "exact")
        options = {name: value for name, value in arguments.items() if name not in ARGUMENTS}
        others = EXACT_OPTIONS if method == "exact" else OPTIONS
        _methods.chosen(method, options, others, "render", ARGUMENTS)
        if arguments.get("max_error") is not None:
            within.checked(arguments["max_error"], arguments)

    def _job(self, scene, camera, arguments):
        given = {name: value for name, value in arguments.items() if name != "max_error"}  # which is None
        return prepared(scene.scene, camera, device=self.device, **given)

    def _within(self, scene, camera, arguments):
        given = {name: value for name, value in arguments.items() if name != "max_error"} | {"device": self.device}
        return within.rendered(
            scene.scene, camera, given, arguments["max_error"], lambda job: scene._upload(job.adapter)
        )

    def _own(self, scene):
        if not isinstance(scene, UploadedScene):
            return self.upload(scene)
        if scene.renderer is not self:
            raise ParameterError("this scene was uploaded by another Renderer: upload it with this one")
        return scene

    def __repr__(self):
        return f"Renderer({self.device!r})"


class UploadedScene:
    """A scene that a `Renderer` keeps on its device.

    Attributes:
        scene: the meshes, as they were.
        renderer: whose it is.
    """

    def __init__(self, renderer, scene):
        self.renderer = renderer
        self.scene = scene
        self._uploads = {}

    def _upload(self, adapter):
        """What the core keeps of this scene on an adapter; None for the CPU, which has it."""
        if adapter is None:
            return None
        return self._uploads.setdefault(adapter, _core.Upload(adapter))

    def __repr__(self):
        return f"UploadedScene({self.scene!r})"
