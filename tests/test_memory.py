"""Memory: any budget that holds one tile's lists gives the same bits, and only what translucent geometry covers costs any."""

import os
import re

import numpy as np
import pytest

import abuffer as ab
import oracle_msaa
import scenes
from comparison import CPU32, CPU64, GPU, GPU_PREFIX, GPU_TILES, U
from oracle_msaa import MODES

EVERY = pytest.mark.parametrize("pipeline", [CPU32, CPU64, GPU, GPU_PREFIX, GPU_TILES], ids=str)
ON_GPU = pytest.mark.parametrize("pipeline", [GPU, GPU_PREFIX], ids=str)
WIDTH, HEIGHT = 80, 64
WIDE = ab.Camera(*scenes.front_camera(WIDTH / HEIGHT))
FIELDS = ("offsets", "depth", "key", "primitive", "color", "coverage", "blend", "background")


def assert_same_bits(frame, other):
    np.testing.assert_array_equal(frame.image, other.image)
    np.testing.assert_array_equal(frame.counts, other.counts)
    for name in FIELDS:
        np.testing.assert_array_equal(getattr(frame.fragments, name), getattr(other.fragments, name))


def crowd(kind):
    """2,000 small triangles, some of them in one corner, and a wall; and the options of a render."""
    triangles, colors = scenes.random_triangles(2000, 0.12, seed=101)
    triangles[:300] = triangles[:300] * 0.2 + (-0.7, 0.7, 0)  # lists are longer there than elsewhere
    wall = ab.Mesh(scenes.random_triangles(3, 0.8, seed=102)[0], colors=(0.3, 0.6, 0.2), opaque=True)
    if kind == "modes":
        pieces = [slice(i, None, 5) for i in range(5)]
        meshes = [ab.Mesh(triangles[p], colors=colors[p], blend=m) for p, m in zip(pieces, MODES, strict=True)]
        return [wall, *meshes], {}
    return [wall, ab.Mesh(triangles, colors=colors)], {"samples": 4} if kind == "samples" else {}


def draw(pipeline, scene, camera=WIDE, **kw):
    options = {"width": WIDTH, "height": HEIGHT, "fragments": True, "background": (0.2, 0.4, 0.1, 0.8)}
    return pipeline.render(scene, camera, **(options | kw))


def held(frame):
    """Bytes of lists, bins and scratch, which a budget is for: all but the scene itself and the image's own size."""
    beside = ("geometry", "setup", "targets", "image band")
    return sum(used for name, used in frame.stats.bytes.items() if name not in beside)


def budgets(frame):
    """From all that a frame used for lists down to almost nothing."""
    used = held(frame)
    return [int(used * 0.6**i) for i in range(20)]


def first_in_bands(render, whole):
    """The frame of the largest of these budgets that needs more bands than `whole`."""
    for memory in budgets(whole):
        frame = render(memory)
        if frame.stats.bands > whole.stats.bands:
            return frame
    raise AssertionError("no budget needs bands")


@EVERY
@pytest.mark.parametrize("kind", ["float32", "samples", "modes"])
def test_bands_cut_anywhere_give_the_same_bits(pipeline, kind):
    scene, options = crowd(kind)
    whole = draw(pipeline, scene, **options)
    assert whole.stats.bands == 1
    bands = []
    for memory in budgets(whole):
        try:
            frame = draw(pipeline, scene, memory=memory, **options)
        except ab.CapacityError:
            break  # less than one tile's lists
        assert_same_bits(frame, whole)
        bands.append(frame.stats.bands)
        if bands[-1] > 32:
            break  # enough cuts
    assert bands == sorted(bands)
    assert len(set(bands)) >= 3, f"bands of {bands}"
    assert len(bands) < 20


@ON_GPU
@pytest.mark.parametrize(
    "node_format", ["rgba8_depth32", "rgba8_depth24_coverage8", "rgb565_depth16", "rgb9e5_alpha8_depth24"]
)
def test_the_range_of_depth_codes_is_that_of_the_frame_not_of_a_band(pipeline, node_format):
    """Else fragments would sort, and lists come back, otherwise in each band. Flat layers: codes that tie are tied in all."""
    triangles, colors = scenes.layers(40, 0.2)
    ramp, shades = scenes.random_triangles(100, 0.3, seed=103)
    ramp[..., 2] += 4 * ramp[..., 1]  # deeper at the bottom than at the top
    scene = [ab.Mesh(triangles, colors=colors), ab.Mesh(ramp, colors=shades)]
    whole = draw(pipeline, scene, node_format=node_format)
    several = first_in_bands(lambda memory: draw(pipeline, scene, memory=memory, node_format=node_format), whole)
    for name in ("offsets", "depth", "key"):
        np.testing.assert_array_equal(getattr(several.fragments, name), getattr(whole.fragments, name))


def test_a_band_of_other_bits_would_be_seen():
    scene, _ = crowd("float32")
    whole = draw(CPU32, scene)
    image = whole.image.copy()
    image[HEIGHT // 2, WIDTH // 2, 0] = np.nextafter(image[HEIGHT // 2, WIDTH // 2, 0], np.float32(2))
    other = object.__new__(ab.Frame)
    other.__dict__.update(whole.__dict__ | {"image": image})
    with pytest.raises(AssertionError):
        assert_same_bits(other, whole)


@EVERY
def test_less_than_the_lists_of_one_tile_says_what_is_needed(pipeline):
    triangles, colors = scenes.layers(3000, 0.01)
    with pytest.raises(ab.CapacityError, match=r"\d+ bytes are needed, but the limit is \d+ bytes; .*memory="):
        pipeline.render(ab.Mesh(triangles, colors=colors), WIDE, width=20, height=16, memory=4096)


@EVERY
def test_what_the_error_says_is_needed_is_enough(pipeline):
    """Raised to what each refusal names, a budget is accepted after a few, and gives the same bits."""
    triangles, colors = scenes.layers(100, 0.01)
    mesh, camera = ab.Mesh(triangles, colors=colors), ab.Camera(*scenes.front_camera())
    size = {"width": 12, "height": 12, "fragments": True}
    memory, tries = 512, 0
    while True:
        try:
            frame = pipeline.render(mesh, camera, memory=memory, **size)
            break
        except ab.CapacityError as error:
            # Part of a budget is for each use, so that the whole may need several times what one use does.
            needed = int(re.search(r"(\d+) bytes are needed", str(error)).group(1))
            memory, tries = max(2 * memory, needed), tries + 1
            assert tries < 16
    assert tries > 0
    assert_same_bits(frame, pipeline.render(mesh, camera, **size))


@EVERY
def test_lists_bins_and_scratch_stay_within_the_budget(pipeline):
    triangles, colors = scenes.layers(1000, 0.01)
    mesh, camera = ab.Mesh(triangles, colors=colors), ab.Camera(*scenes.front_camera())
    whole = pipeline.render(mesh, camera, width=32, height=32)
    # On the CPU a thread keeps beside its lists what a tile's 256 pixels always need.
    fixed = 16 * 1024 * (os.cpu_count() or 1) if pipeline.device == "cpu" else 0
    smallest = whole
    for memory in budgets(whole):
        try:
            frame = pipeline.render(mesh, camera, width=32, height=32, memory=memory)
        except ab.CapacityError:
            break
        assert held(frame) <= memory + fixed
        smallest = frame
        if frame.stats.bands > 32:
            break
    assert held(smallest) < held(whole) / 2


# ---- only what is covered ----


def corner_object():
    """A few triangles in pixels 16 to 48 of each axis of an image of 512 × 256, with lists of up to 8."""
    rng = np.random.default_rng(104)
    corners = rng.uniform(17, 47, (8, 3, 2))
    z = np.arange(8)[:, None, None] / 8 + np.zeros((8, 3, 1))
    triangles = np.concatenate([corners[..., :1], 256 - corners[..., 1:], z], axis=-1)
    return ab.Mesh(triangles, colors=rng.uniform(0.2, 0.8, (8, 4)), color_mode="face")


LARGE = ab.Camera.orthographic((256, 128, 3), (256, 128, 0), height=256)


@EVERY
def test_a_small_object_in_a_large_image_is_rendered_where_it_is(pipeline):
    frame = pipeline.render(
        corner_object(), LARGE, width=512, height=256, fragments="count", background=(0.1, 0.2, 0.3, 1)
    )
    small = ab.Camera.orthographic((32, 256 - 32, 3), (32, 256 - 32, 0), height=64)
    alone = pipeline.render(
        corner_object(), small, width=64, height=64, fragments="count", background=(0.1, 0.2, 0.3, 1)
    )
    assert alone.counts.max() >= 4
    np.testing.assert_array_equal(frame.counts[:64, :64], alone.counts)
    # The image around it is of other float32 coordinates: a flat colour does not change with them.
    np.testing.assert_array_equal(frame.image[:64, :64], alone.image)
    assert (frame.counts[64:] == 0).all()
    assert (frame.counts[:, 64:] == 0).all()
    behind = np.float32((0.1, 0.2, 0.3, 1)) if pipeline is not CPU64 else np.array((0.1, 0.2, 0.3, 1))
    np.testing.assert_array_equal(frame.image[64:], np.broadcast_to(behind, (192, 512, 4)))


@EVERY
def test_the_plan_names_the_rectangle_and_the_tiles_that_hold_translucent_geometry(pipeline):
    frame = pipeline.render(corner_object(), LARGE, width=512, height=256, fragments="count")
    x0, x1, y0, y1 = map(int, re.fullmatch(r"(\d+)\.\.(\d+) × (\d+)\.\.(\d+)", frame.plan["rectangle"]).groups())
    # What is covered lies in it, and it is no more than a tile larger on any side.
    y, x = np.nonzero(frame.counts)
    assert x.min() - 16 <= x0 <= x.min() <= x.max() < x1 <= x.max() + 17
    assert y.min() - 16 <= y0 <= y.min() <= y.max() < y1 <= y.max() + 17
    some, all_of_them = map(
        int, re.fullmatch(r"(\d+) of (\d+) hold translucent geometry", frame.plan["tiles"]).groups()
    )
    # 16 × 16 or 8 × 8 pixels a tile, whichever a pipeline has.
    assert all_of_them in (32 * 16, 64 * 32)
    assert 1 <= some <= (9 if all_of_them == 512 else 25)


@EVERY
def test_memory_follows_the_object_not_the_image(pipeline):
    """What lists take of a large image with a small object is what they take of a small one, within a tile's rim."""
    bytes_of = []
    for width, height in ((64, 64), (512, 256), (2048, 1024)):
        camera = ab.Camera.orthographic(
            (width / 2, 256 - height / 2, 3), (width / 2, 256 - height / 2, 0), height=height
        )
        bytes_of.append(held(pipeline.render(corner_object(), camera, width=width, height=height)))
    # The CPU has a counter for each 16×16 tile, and so have lists that a plan is made from for each row.
    assert bytes_of[2] <= 2 * bytes_of[0] + 4 * (2048 // 16) * (1024 // 16) + 65536


@EVERY
def test_an_image_with_nothing_translucent_needs_no_lists(pipeline):
    wall = ab.Mesh(scenes.covering()[0], colors=(0.2, 0.4, 0.6), opaque=True)
    for scene in (wall, ab.Scene(), ab.Mesh(scenes.covering()[0] + (0, 0, 9))):
        frame = pipeline.render(scene, ab.Camera(*scenes.front_camera()), width=64, height=64)
        assert frame.stats.fragments == 0
        # Counters of tiles; and on the CPU what a thread keeps for a tile's pixels, opaque ones too.
        assert held(frame) <= (4096 if pipeline.device == "gpu" else 16 * 1024 * (os.cpu_count() or 1))
        assert np.isfinite(frame.image).all()


# ---- large images ----


@EVERY
@pytest.mark.parametrize("size", [(16384, 64), (64, 16384)], ids=str)
def test_the_longest_image_is_the_same_in_bands(pipeline, size):
    """Layers over all of it, and triangles across."""
    width, height = size
    camera = ab.Camera.orthographic((width / 2, height / 2, 9), (width / 2, height / 2, 0), height=height)
    rng = np.random.default_rng(105)
    corners = rng.uniform(-0.2, 1.2, (12, 3, 2)) * (width, height)
    triangles = np.concatenate([corners, np.arange(12)[:, None, None] / 4 + np.zeros((12, 3, 1))], axis=-1)
    mesh = ab.Mesh(triangles, colors=rng.uniform(0.1, 0.9, (12, 4)), color_mode="face")
    options = {"width": width, "height": height, "fragments": "count", "background": (0.2, 0.3, 0.4, 1)}
    whole = pipeline.render(mesh, camera, **options)
    assert whole.counts.max() >= 6
    several = first_in_bands(lambda memory: pipeline.render(mesh, camera, memory=memory, **options), whole)
    np.testing.assert_array_equal(several.image, whole.image)
    np.testing.assert_array_equal(several.counts, whole.counts)
    checked = 0
    for x, y in rng.integers(0, size, (200, 2)):
        sides = [signed_distances(triangle[:, :2], (x + 0.5, height - y - 0.5)) for triangle in triangles]
        if np.abs(sides).min() < 0.1:
            continue  # of 16,384 pixels float32 keeps hundredths
        hit = np.flatnonzero(np.min(sides, axis=1) > 0)[::-1]  # nearest first, since z rises
        assert whole.counts[y, x] == len(hit)
        color, behind = mesh.colors[hit], np.array([(0.2, 0.3, 0.4, 1)])
        wanted = oracle_msaa.blend_lists(np.array([0, len(hit)]), color, behind)[0]
        np.testing.assert_allclose(whole.image[y, x], wanted, rtol=2 * (len(hit) + 2) * U)
        checked += 1
    assert checked > 100


def signed_distances(corners, point):
    """Of a point to a triangle's three edges, positive inside, whatever the winding."""
    p, q = corners, np.roll(corners, -1, axis=0)
    (ux, uy), (vx, vy) = (q - p).T, (np.array(point) - p).T
    turn = np.sign(ux[0] * uy[1] - uy[0] * ux[1])
    return turn * (ux * vy - uy * vx) / np.hypot(ux, uy)


def free_memory():
    """Bytes that a process may still take, or None where nothing says."""
    try:
        with open("/proc/meminfo", encoding="ascii") as file:
            found = re.search(r"MemAvailable:\s*(\d+) kB", file.read())
    except OSError:
        return None
    return int(found.group(1)) * 1024 if found else None


@pytest.mark.slow
@pytest.mark.parametrize("pipeline", [CPU32, GPU, GPU_TILES], ids=str)
def test_the_largest_image_of_all(pipeline):
    """16384 × 16384: 4 GiB of image, more than any binding or buffer; three triangles over part of it."""
    needed = 10 * 2**30  # the image, and whatever a readback holds beside it
    free = free_memory()
    if free is None or free < needed:
        pytest.skip(f"needs {needed >> 30} GiB of free memory, there are {(free or 0) / 2**30:.1f}")
    size = 16384
    camera = ab.Camera.orthographic((size / 2, size / 2, 9), (size / 2, size / 2, 0), height=size)
    corners = np.array([[(0, 0), (size, 0), (0, size)], [(4000, 4000), (4300, 4000), (4000, 4300)],
                        [(16000, 16000), (16384, 16000), (16384, 16384)]], np.float64)  # fmt: skip
    triangles = np.concatenate([corners, np.arange(3)[:, None, None] + np.zeros((3, 3, 1))], axis=-1)
    colors = np.float32([(1, 0, 0, 0.5), (0, 1, 0, 0.5), (0, 0, 1, 0.25)])
    frame = pipeline.render(
        ab.Mesh(triangles, colors=colors, color_mode="face"), camera, width=size, height=size, memory="1GiB"
    )
    assert frame.image.shape == (size, size, 4)
    # y counts down: world y is size - (row + 0.5).
    np.testing.assert_array_equal(frame.image[size - 10, 10], (0.5, 0, 0, 0.5))
    np.testing.assert_array_equal(frame.image[size - 4100, 4100], (0.25, 0.5, 0, 0.75))
    np.testing.assert_array_equal(frame.image[size - 16101, 16201], (0, 0, 0.25, 0.25))
    np.testing.assert_array_equal(frame.image[10, size // 2], (0, 0, 0, 0))
    # The half of the image, the small triangles: fragments are pixels' areas, up to the diagonals.
    wanted = size**2 / 2 + 300**2 / 2 + 384**2 / 2
    assert abs(frame.stats.fragments - wanted) <= size + 300 + 384
