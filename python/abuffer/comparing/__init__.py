"""Comparing methods: what each costs, and how far off its image is.

Stands on `render`; nothing below knows of it. Packages beside numpy are imported where they are used.
"""

from ..errors import ParameterError
from ..job import _image_size
from . import store
from .comparison import Comparison
from .entries import entries
from .environment import environment
from .measuring import FRAMES_ON_CPU, FRAMES_ON_GPU, device_name, is_real_gpu, measured, reference_of
from .subjects import same_size, subjects

# Lists that a comparison keeps for looking at, of each scene.
MOST_FRAGMENTS = 4_000_000


def compare(
    scenes,
    camera=None,
    *,
    width=None,
    height=None,
    methods=None,
    sweep=None,
    devices=None,
    repeats=None,
    warmup=5,
    reference="float64",
    save=None,
    resume=False,
    progress=None,
) -> Comparison:
    """Measures what methods cost on scenes, and how far off their images are.

    Every method renders each scene on each device: some frames to warm up, the first three of which must be the same to the
    bit, then frames in turns with the other methods', so that what slows one slows all. Errors are of the first frame, in linear
    floats.

    Args:
        scenes: a scene, or anything that `Scene.add` takes; a standard scene, whose camera and background are its own; a list of
            such; or a dict of them by name.
        camera: of scenes that have none. None: `Camera.fit`.
        width, height: pixels. None: those of `render`.
        methods: a list of ids, "id@pipeline" (as in "wboit@hardware"; without one it is tiles), or dicts with "method",
            parameters by name, and perhaps "pipeline" and "label". None: every method, on every pipeline of the device.
        sweep: {"mlab": {"k": [2, 4, 8, 16]}}: a row for each value, drawn as a curve; of several parameters for each
            combination. Beside `methods`; where those are None, in place of that method with its defaults.
        devices: a list of devices, as `device=` of `render`. None: that of "auto".
        repeats: frames that are timed. None: 30 on a real GPU, 5 on others. Of a method that takes seconds for one, three may
            be all: `frames` says.
        warmup: frames before those, at least three.
        reference: "float64": exact on the CPU. Or the image itself, (H, W, 4), premultiplied; of several scenes a dict by name.
        save: a folder that the comparison is written to after every scene and device. None: none.
        resume: what `save` holds already is not measured again.
        progress: called with (done, all, what) before each step: numbers of steps, and text.

    Returns a Comparison.

    Raises:
        ParameterError: an argument is none of those. What a device cannot render is a row with its `failure`.

    >>> from abuffer import Mesh, compare
    >>> sheets = Mesh([[[-9, -9, z], [9, -9, z], [0, 9, z]] for z in (0, 1, 2)], colors=(1, .5, 0, .5))
    >>> compared = compare(sheets, width=16, height=16, methods=["exact", "wboit", "additive"], devices=["cpu"])
    >>> [(row["label"], row["max_abs"] < 1e-6) for row in compared.rows]  # equal colours are exact in wboit
    [('exact', True), ('wboit', True), ('additive', False)]
    """
    all_subjects = subjects(scenes, camera)
    devices = ["auto"] if devices is None else devices
    if isinstance(devices, str):
        raise ParameterError(f"devices must be a list, got {devices!r}: give [{devices!r}]")
    if save is not None and not resume and store.holds(save):
        raise ParameterError(f"{str(save)!r} holds a comparison: give resume=True to go on with it, or another folder")
    if resume and save is None:
        raise ParameterError("resume continues what save holds: give the folder as save=")
    cells = [(subject, device, device_name(device)) for subject in all_subjects for device in devices]
    asked = {name: entries(methods, sweep, is_gpu=name != "cpu") for _, _, name in cells}
    compared = store.load(save) if resume and store.holds(save) else Comparison([], environment(devices))
    sizes = {each.name: _image_size(width, height, each.camera, each.background) for each in all_subjects}
    for subject, _, name in cells:
        _check_same(compared, subject, name, sizes[subject.name], asked[name])
    left = [cell for cell in cells if (cell[0].name, cell[2]) not in compared.cells]
    counts = {device: _repeats(repeats, device) for _, device, _ in cells}
    steps = _Steps(progress, sum(len(asked[name]) + counts[device] for _, device, name in left))
    for subject, device, name in left:
        size = sizes[subject.name]
        exact = compared.exact.get(subject.name) or reference_of(subject, size, MOST_FRAGMENTS)
        wanted = _reference(reference, subject, exact, size)
        rows, images = measured(subject, device, asked[name], size, wanted, exact, counts[device], warmup, steps.step)
        compared.add(subject.name, name, rows, images, exact, wanted)
        if save is not None:
            compared.save(save)
    return compared


def _check_same(compared, subject, device, size, asked):
    """Raises a ParameterError if what was measured of a scene and a device is not what is asked for now."""
    exact = compared.exact.get(subject.name)
    if exact is not None and exact.image.shape[1::-1] != size:
        height, width = exact.image.shape[:2]
        raise ParameterError(
            f"{subject.name} was measured at {width}×{height}, and {size[0]}×{size[1]} is asked for: save to another folder"
        )
    measured = {row["label"] for row in compared.select(scene=subject.name, device=device)}
    labels = {entry.label for entry in asked}
    if measured and measured != labels:
        raise ParameterError(
            f"{subject.name} was measured with other methods ({', '.join(sorted(measured ^ labels))}): save to another folder"
        )


def _repeats(repeats, device):
    if repeats is None:
        return FRAMES_ON_GPU if is_real_gpu(device) else FRAMES_ON_CPU
    if not isinstance(repeats, int) or repeats < 1:
        raise ParameterError(f"repeats must be at least 1, got {repeats!r}")
    return repeats


def _reference(reference, subject, exact, size):
    if isinstance(reference, str):
        if reference != "float64":
            raise ParameterError(f'reference must be "float64" or an image, got {reference!r}')
        return exact.image
    if isinstance(reference, dict):
        if subject.name not in reference:
            raise ParameterError(f"reference has no image of scene {subject.name!r}: it has {', '.join(reference)}")
        reference = reference[subject.name]
    return same_size(reference, size)


class _Steps:
    """Tells how far a comparison is."""

    def __init__(self, progress, all):
        self.progress, self.all, self.done = progress, all, 0

    def step(self, what):
        if self.progress is not None:
            self.progress(self.done, self.all, what)
        self.done += 1
