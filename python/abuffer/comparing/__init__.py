"""Comparing methods: what each costs, and how far off its image is.

Stands on `render`; nothing below knows of it. Packages beside numpy are imported where they are used.
"""

from ..errors import ParameterError
from ..job import _image_size
from ..method import Parameter
from . import references, store
from .comparison import Comparison
from .entries import as_list, entries, listed
from .environment import environment
from .measuring import FRAMES_ON_CPU, FRAMES_ON_GPU, device_name, is_real_gpu, measured
from .resuming import check_environment, check_same, fingerprint
from .subjects import subjects

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
    background=None,
    save=None,
    resume=False,
    progress=None,
) -> Comparison:
    """Measures what methods cost on scenes, and how far off their images are.

    Every method renders each scene on each device: some frames to warm up, the first three of which must be the same to the
    bit, then frames in turns with the other methods', so that what slows one slows all. Errors are of the first frame, in linear
    floats.

    Args:
        scenes: a scene, or anything that `Scene.add` takes; a standard scene, whose camera and background are its own; or several:
            a dict by name, or a list in which there is a Scene or a standard scene. A list of meshes or files is one scene.
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
        reference: "float64": exact, and all of it in float64. "fragments": what float32 rasterises, as methods do, composited in
            float64, on the CPU; errors are then of compositing alone, and no triangle's edge is among them. (A GPU's fragments
            differ from these in roundings.) Or an image of your own, (H, W, 4) floats, premultiplied and linear; of several
            scenes a dict by name.
        background: of scenes that have none, as in `render`. None: transparent.
        save: a folder that the comparison is written to after every scene and device. None: none.
        resume: what `save` holds already is not measured again, and is in what is returned. It must be of the same scenes, cameras,
            methods and reference.
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
    all_subjects = subjects(scenes, camera, background)
    sizes = {each.name: _image_size(width, height, each.camera, each.background) for each in all_subjects}
    warmup = Parameter("warmup", 5, "").checked(warmup)
    by_name = _by_name(["auto"] if devices is None else devices)
    methods, sweep = listed(methods, sweep)
    asked = {name: entries(methods, sweep, is_gpu=name != "cpu") for name in by_name}
    counts = {name: _repeats(repeats, device) for name, device in by_name.items()}
    images = references.given(reference, all_subjects, sizes)
    every = [entry for own in asked.values() for entry in own]
    prints = {
        each.name: fingerprint(each, sizes[each.name], images.get(each.name, reference), every) for each in all_subjects
    }
    compared = _begun(save, resume, environment(by_name.values()))
    cells = [(subject, name) for subject in all_subjects for name in by_name]
    for subject, name in cells:
        check_same(compared, subject.name, name, prints[subject.name], asked[name])
    left = [(subject, name) for subject, name in cells if (subject.name, name) not in compared.cells]
    steps = _Steps(progress, sum(len(asked[name]) + counts[name] for _, name in left))
    for subject, name in left:
        size = sizes[subject.name]
        exact = compared.exact.get(subject.name)
        if exact is None:
            exact = references.exact_of(subject, size, MOST_FRAGMENTS, reference)
        wanted = images.get(subject.name, exact.image)
        frames = counts[name], warmup
        rows, rendered = measured(subject, by_name[name], asked[name], size, wanted, exact, frames, steps.step)
        compared.add(subject.name, name, rows, rendered, exact, wanted)
        compared.asked[subject.name] = prints[subject.name]
        if save is not None:
            store.save(compared, save, subject.name)
    return compared


def _by_name(devices) -> dict:
    """Devices as given, by name: each once, even where two words mean one."""
    by_name = {}
    for device in as_list("devices", devices):
        by_name.setdefault(device_name(device), device)
    if not by_name:
        raise ParameterError("devices is empty: give at least one, or None")
    return by_name


def _begun(save, resume, where):
    """The comparison that `save` holds if it is to be resumed, else one without rows."""
    if save is None:
        if resume:
            raise ParameterError("resume continues what save holds: give the folder as save=")
        return Comparison([], where)
    if not store.holds(save):
        store.made(save)
        return Comparison([], where)
    if not resume:
        raise ParameterError(f"{str(save)!r} holds a comparison: give resume=True to go on with it, or another folder")
    compared = store.load(save)
    check_environment(compared.environment, where)
    compared.environment = where | {"devices": compared.environment["devices"] | where["devices"]}
    return compared


def _repeats(repeats, device):
    if repeats is None:
        return FRAMES_ON_GPU if is_real_gpu(device) else FRAMES_ON_CPU
    return Parameter("repeats", 1, "", low=1).checked(repeats)


class _Steps:
    """Tells how far a comparison is."""

    def __init__(self, progress, all):
        self.progress, self.all, self.done = progress, all, 0

    def step(self, what):
        if self.progress is not None:
            self.progress(self.done, self.all, what)
        self.done += 1
