"""What a Mesh takes, what it refuses, and what it keeps."""

import copy
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import abuffer as ab

TRIANGLE = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)]
SQUARE = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
TWO = [(0, 1, 2), (0, 2, 3)]
TETRAHEDRON = [(0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3)]  # as many faces as positions

# positions and faces


def test_every_three_positions_are_a_triangle():
    mesh = ab.Mesh(TRIANGLE * 2)
    assert mesh.faces is None
    assert mesh.face_count == 2
    np.testing.assert_array_equal(mesh.triangles(), [TRIANGLE, TRIANGLE])


def test_positions_may_come_as_triangles():
    given = np.arange(18.0).reshape(2, 3, 3)
    mesh = ab.Mesh(given)
    assert mesh.positions.shape == (6, 3)
    np.testing.assert_array_equal(mesh.triangles(), given)


def test_faces_index_positions():
    mesh = ab.Mesh(SQUARE, TWO)
    np.testing.assert_array_equal(mesh.triangles(), np.array(SQUARE)[np.array(TWO)])


@pytest.mark.parametrize(
    ("given", "kept"),
    [
        (np.float32, np.float32),
        (np.float64, np.float64),
        (np.float16, np.float32),
        (np.int64, np.float64),
        (np.uint8, np.float64),
        (">f4", np.float32),
    ],
)
def test_positions_keep_float32_and_float64(given, kept):
    positions = ab.Mesh(np.array(TRIANGLE).astype(given)).positions
    assert positions.dtype == kept
    assert positions.dtype.isnative
    np.testing.assert_array_equal(positions, TRIANGLE)


@pytest.mark.parametrize("dtype", [np.uint8, np.int32, np.int64, np.uint64])
def test_faces_are_of_any_integer_type(dtype):
    np.testing.assert_array_equal(ab.Mesh(SQUARE, np.array(TWO, dtype)).faces, TWO)


@pytest.mark.parametrize(
    ("positions", "faces"),
    [
        ([], None),
        ([], []),
        (np.zeros((0, 3)), None),
        (np.zeros((0, 3)), np.zeros((0, 3), int)),
        (np.zeros((0, 3, 3), np.float32), None),
        (TRIANGLE, []),
    ],
)
def test_a_mesh_may_be_empty(positions, faces):
    mesh = ab.Mesh(positions, faces)
    assert mesh.face_count == 0
    assert mesh.triangles().shape == (0, 3, 3)


@pytest.mark.parametrize("colors", [(1, 0, 0), np.zeros((0, 4)), np.zeros((0, 3, 3))])
def test_an_empty_mesh_takes_colours_at_every_rate(colors):
    assert ab.Mesh(np.zeros((0, 3)), [], colors).face_count == 0


def test_positions_without_faces_are_used_up_by_triangles():
    with pytest.raises(ab.SceneError, match="positions has 4 rows; without faces every three are a triangle"):
        ab.Mesh(SQUARE)


@pytest.mark.parametrize(
    ("positions", "message"),
    [
        (np.zeros(9), r"positions must have shape \(N, 3\) or \(T, 3, 3\), got \(9,\)"),
        (np.zeros((3, 4)), r"got \(3, 4\): transpose it"),
        (np.zeros((2, 4, 3)), r"got \(2, 4, 3\)"),
        (0.0, r"got \(\)"),
        ("box", "positions must be numbers, got dtype <U3"),
        (None, "positions must be numbers, got dtype object"),
        (np.zeros((3, 3), complex), "got dtype complex128"),
        ([(0, 0, 0), (1, 0)], "positions is not an array"),
        ([(0, 0, 0), (1, 0, np.nan), (0, np.inf, 0)], r"positions\[1, 2\] is nan \(2 such values\): .*finite"),
    ],
)
def test_positions_that_are_refused(positions, message):
    with pytest.raises(ab.SceneError, match=message):
        ab.Mesh(positions)


def test_a_long_double_beyond_a_double_is_refused():
    if np.finfo(np.longdouble).max == np.finfo(np.float64).max:
        pytest.skip("no wider float here")
    with pytest.raises(ab.SceneError, match=r"positions\[0, 0\] is inf"):
        ab.Mesh(np.full((3, 3), np.finfo(np.longdouble).max))


@pytest.mark.parametrize(
    ("faces", "message"),
    [
        ([(0, 1, 4)], r"faces\[0, 2\] is 4: there are 4 positions, 0 to 3"),
        ([(0, 1, 2), (-1, 1, 2)], r"faces\[1, 0\] is -1"),
        ([(0.0, 1.0, 2.0)], "faces must be integers, got dtype float64"),
        ([(True, False, True)], "faces must be integers, got dtype bool"),
        ([(0, 1, 2, 3)], r"faces must have shape \(M, 3\), got \(1, 4\)"),
        ([0, 1, 2], r"got \(3,\)"),
        (np.zeros((0, 4), int), r"got \(0, 4\)"),
        ([(0, 1, 2), (0, 1)], "faces is not an array"),
    ],
)
def test_faces_that_are_refused(faces, message):
    with pytest.raises(ab.SceneError, match=message):
        ab.Mesh(SQUARE, faces)


def test_faces_of_no_positions():
    with pytest.raises(ab.SceneError, match=r"faces\[0, 0\] is 0 \(3 such values\): there are no positions"):
        ab.Mesh([], [(0, 0, 0)])


def test_triangles_take_no_faces():
    with pytest.raises(ab.SceneError, match=r"positions of shape \(2, 3, 3\) are triangles already"):
        ab.Mesh(np.zeros((2, 3, 3)), [(0, 1, 2)])


# colours


def test_without_colours_it_is_a_translucent_blue():
    mesh = ab.Mesh(TRIANGLE)
    np.testing.assert_array_equal(mesh.colors, (0.30, 0.55, 0.85, 0.5))
    assert mesh.color_mode == "one"


@pytest.mark.parametrize(
    ("shape", "mode"), [((4,), "one"), ((4, 4), "vertex"), ((2, 4), "face"), ((2, 3, 4), "corner")]
)
@pytest.mark.parametrize("channels", [3, 4])
def test_the_shape_of_colours_says_what_they_are_for(shape, mode, channels):
    colors = np.random.default_rng(1).random(shape)[..., :channels]
    mesh = ab.Mesh(SQUARE, TWO, colors)
    assert mesh.color_mode == mode
    assert mesh.colors.shape == shape
    np.testing.assert_array_equal(mesh.colors[..., :channels], colors)
    if channels == 3:
        assert (mesh.colors[..., 3] == 1).all()


@pytest.mark.parametrize("mode", ["vertex", "face"])
def test_as_many_faces_as_positions_need_a_color_mode(mode):
    positions, colors = [*TRIANGLE, (0, 0, 1)], np.eye(4)
    assert ab.Mesh(positions, TETRAHEDRON, colors, color_mode=mode).color_mode == mode
    with pytest.raises(ab.SceneError, match=r'colors of 4 rows fit both .*color_mode="vertex" or color_mode="face"'):
        ab.Mesh(positions, TETRAHEDRON, colors)


def test_as_many_faces_as_positions_need_no_color_mode_elsewhere():
    positions = [*TRIANGLE, (0, 0, 1)]
    assert ab.Mesh(positions, TETRAHEDRON, (1, 0, 0)).color_mode == "one"
    assert ab.Mesh(positions, TETRAHEDRON, np.zeros((4, 3, 4))).color_mode == "corner"


def test_a_color_mode_must_fit():
    with pytest.raises(ab.SceneError, match=r"colors of shape \(2, 4\) .* are not one a vertex: .*4 positions and 2"):
        ab.Mesh(SQUARE, TWO, np.zeros((2, 4)), color_mode="vertex")
    with pytest.raises(ab.ParameterError, match=r"color_mode must be one of .*got 'vertices'; did you mean 'vertex'"):
        ab.Mesh(SQUARE, TWO, np.zeros((4, 4)), color_mode="vertices")


@pytest.mark.parametrize(
    ("given", "kept", "value"),
    [
        (np.array([51, 0, 255, 102], np.uint8), np.float64, (0.2, 0, 1, 0.4)),
        (np.array([1, 0, 1, 1], np.uint8), np.float64, (1 / 255, 0, 1 / 255, 1 / 255)),
        ([1, 0, 1, 0], np.float64, (1, 0, 1, 0)),
        (np.array([1, 0, 1], np.int8), np.float64, (1, 0, 1, 1)),
        (np.array([True, False, True]), np.float64, (1, 0, 1, 1)),
        (np.array([0.5, 0, 7, 1], np.float16), np.float32, (0.5, 0, 7, 1)),
        (np.array([0.1, 0, 7, 1], np.float32), np.float32, np.array([0.1, 0, 7, 1], np.float32)),
        ((0.1, 1e30, 0, 1), np.float64, (0.1, 1e30, 0, 1)),  # HDR
    ],
    ids=["uint8", "dark uint8", "int", "int8", "bool", "float16", "float32", "float64"],
)
def test_colour_types(given, kept, value):
    colors = ab.Mesh(TRIANGLE, colors=given).colors
    assert colors.dtype == kept
    np.testing.assert_array_equal(colors, value)


@pytest.mark.parametrize(
    ("colors", "message"),
    [
        ((255, 0, 0), r"colors\[0\] is 255: int64 may only be 0 and 1: give floats, or uint8 for 0 to 255"),
        ([(0, 1, 0), (0, -1, 0), (0, 0, 0)], r"colors\[1, 1\] is -1: int64 may only"),
        ((0.1, -0.5, 0, 1), r"colors\[1\] is -0.5: RGB must be finite and at least 0, alpha in \[0, 1\]"),
        ([(0, 0, 0, 0.5), (0, 0, 0, 1.5), (0, 0, 0, 2.0)], r"colors\[1, 3\] is 1.5 \(2 such values\)"),
        ((0, 0, 0, -1e-9), r"colors\[3\] is -1e-09"),
        ((0, np.nan, 0), r"colors\[1\] is nan"),
        ((0, np.inf, 0, 1), r"colors\[1\] is inf"),
        (0.5, r"colors must end in 3 or 4 channels, got shape \(\)"),
        (np.zeros((3, 2)), r"got shape \(3, 2\)"),
        ([], r"got shape \(0,\)"),
        ("red", "colors must be numbers, got dtype <U3"),
        (None, "colors must be numbers, got dtype object"),
        (np.zeros((7, 4)), r"colors of shape \(7, 4\) \(with alpha\) fit neither 3 positions nor 1 faces"),
        ([(0, 0, 0), (0, 0)], "colors is not an array"),
    ],
)
def test_colours_that_are_refused(colors, message):
    with pytest.raises(ab.SceneError, match=message):
        ab.Mesh(TRIANGLE, colors=colors)


def test_alpha_multiplies_the_colours_alpha():
    np.testing.assert_array_equal(ab.Mesh(TRIANGLE, alpha=0.5).colors, (0.30, 0.55, 0.85, 0.25))
    colors = np.array([(1, 1, 1, 0), (1, 1, 1, 0.5), (1, 1, 1, 1)], np.float32)
    mesh = ab.Mesh(TRIANGLE, colors=colors, alpha=0.25)
    np.testing.assert_array_equal(mesh.colors[:, 3], (0, 0.125, 0.25))
    np.testing.assert_array_equal(mesh.colors[:, :3], 1)
    assert mesh.colors.dtype == np.float32


# how it is drawn


@pytest.mark.parametrize(
    ("option", "value", "message"),
    [
        ("alpha", 1.5, "alpha must be between 0.* and 1.*, got 1.5"),
        ("alpha", "0.5", "alpha must be a number, got '0.5'"),
        ("alpha", np.nan, "alpha must be .* got nan"),
        ("alpha", [0.5], r"alpha must be a number, got \[0.5\]"),
        ("alpha", True, "alpha must be a number, got True"),
        ("blend", "add", "blend must be one of 'over', 'additive', .* got 'add'"),
        ("blend", "ovr", "did you mean 'over'"),
        ("blend", "dst + src.rgb", "a blend of your own is an abuffer.Blend"),
        ("blend", max, "a blend of your own is an abuffer.Blend"),
        ("blend", None, "blend must be one of"),
        ("cull", "both", "cull must be one of None, 'back', 'front', got 'both'"),
        ("cull", False, "cull must be one of None, 'back', 'front', got False"),
        ("opaque", "no", "opaque must be True or False, got 'no'"),
        ("opaque", None, "opaque must be True or False, got None"),
    ],
)
def test_options_that_are_refused(option, value, message):
    with pytest.raises(ab.ParameterError, match=message):
        ab.Mesh(TRIANGLE, **{option: value})


def test_an_alpha_cutoff_is_for_opaque_meshes():
    assert ab.Mesh(TRIANGLE, opaque=True, alpha_cutoff=0.5).alpha_cutoff == 0.5
    with pytest.raises(ab.ParameterError, match="give opaque=True with it"):
        ab.Mesh(TRIANGLE, alpha_cutoff=0.5)
    with pytest.raises(ab.ParameterError, match="alpha_cutoff must be between"):
        ab.Mesh(TRIANGLE, opaque=True, alpha_cutoff=-0.1)


LIGHTEN = ab.Blend("max(dst, src.rgb)", max)


@pytest.mark.parametrize("blend", [*ab.BLENDS, LIGHTEN])
def test_a_mesh_keeps_its_blend(blend):
    mesh = ab.Mesh(TRIANGLE, blend=blend)
    assert mesh.blend is blend
    assert mesh.transformed(np.eye(4)).replaced(alpha=0.5).blend is blend


def test_without_a_blend_it_is_over():
    assert ab.Mesh(TRIANGLE).blend == "over"


@pytest.mark.parametrize("blend", [*ab.BLENDS[1:], LIGHTEN])
def test_opaque_meshes_are_not_blended(blend):
    ab.Mesh(TRIANGLE, opaque=True, blend="over")
    with pytest.raises(ab.ParameterError, match=r"not blended: give opaque=False, or blend=\"over\" instead of"):
        ab.Mesh(TRIANGLE, opaque=True, blend=blend)


@pytest.mark.parametrize("blend", ["multiply", "screen"])
def test_multiply_and_screen_take_rgb_up_to_one(blend):
    ab.Mesh(TRIANGLE, colors=(1, 1, 1, 1), blend=blend)
    colors = np.array([(0, 0.5, 1, 1), (0, 0.5, 1.5, 1), (2, 0, 0, 1)])
    with pytest.raises(ab.SceneError, match=r"colors\[1, 2\] is 1.5 \(2 such values\): .*multiply and screen take RGB"):
        ab.Mesh(TRIANGLE, colors=colors, blend=blend)
    with pytest.raises(ab.SceneError, match=r"colors\[0, 2, 1\] is 1.0000001"):
        ab.Mesh(TRIANGLE, colors=[[(0, 0, 0), (0, 0, 0), (0, np.float32(1.0000001), 0)]], blend=blend)


@pytest.mark.parametrize("blend", ["over", "additive", "premultiplied", LIGHTEN])
def test_other_blends_take_any_rgb(blend):
    assert ab.Mesh(TRIANGLE, colors=(7.0, 0, 0), blend=blend).colors[0] == 7


def test_numpy_scalars_are_numbers_and_flags():
    mesh = ab.Mesh(TRIANGLE, alpha=np.float32(0.5), opaque=np.True_, alpha_cutoff=np.array(0.25))
    assert (mesh.colors[3], mesh.opaque, mesh.alpha_cutoff) == (0.25, True, 0.25)


# read-only


def test_a_mesh_is_read_only():
    mesh = ab.Mesh(SQUARE, TWO, np.zeros((4, 4)))
    for array in (mesh.positions, mesh.faces, mesh.colors):
        with pytest.raises(ValueError, match="read-only"):
            array[0, 0] = 1
    with pytest.raises(AttributeError, match="a Mesh is read-only"):
        mesh.opaque = True
    with pytest.raises(AttributeError, match="a Mesh is read-only"):
        del mesh.name


def test_what_becomes_of_the_arrays_given_does_not_show():
    positions, faces, colors = np.array(SQUARE, float), np.array(TWO, np.uint32), np.ones((4, 4))
    mesh = ab.Mesh(positions, faces, colors)
    positions[:], faces[:], colors[:] = np.nan, 99, -1
    np.testing.assert_array_equal(mesh.triangles(), np.array(SQUARE)[np.array(TWO)])
    np.testing.assert_array_equal(mesh.colors, 1)


def test_arrays_given_stay_writeable():
    positions = np.array(TRIANGLE)
    ab.Mesh(positions)
    positions[0] = 7


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, lambda m: pickle.loads(pickle.dumps(m))])
def test_copies_are_equal_and_read_only(copied):
    mesh = ab.Mesh(SQUARE, TWO, np.eye(4), opaque=True, alpha_cutoff=0.25, cull="back", name="n")
    other = copied(mesh)
    for field in ab.Mesh.__slots__:
        np.testing.assert_array_equal(getattr(other, field), getattr(mesh, field))
    assert not other.positions.flags.writeable
    assert copied(ab.Mesh(TRIANGLE, blend=LIGHTEN)).blend == LIGHTEN


def test_replaced_changes_what_is_named():
    mesh = ab.Mesh(SQUARE, TWO, np.eye(4), name="a")
    other = mesh.replaced(colors=np.zeros((2, 3)), opaque=True)
    assert (other.color_mode, other.opaque, other.name) == ("face", True, "a")
    assert (mesh.color_mode, mesh.opaque) == ("vertex", False)


def test_repr_tells_what_is_there():
    assert repr(ab.Mesh(SQUARE, TWO, opaque=True)) == "Mesh(2 faces, 4 vertices, one color, opaque)"
    assert repr(ab.Mesh(TRIANGLE, blend="screen")) == "Mesh(1 face, 3 vertices, one color, screen)"
    assert repr(ab.Mesh(TRIANGLE, blend=ab.Blend("dst"))) == "Mesh(1 face, 3 vertices, one color, Blend(wgsl='dst'))"


# transforms

MIRROR = np.diag([-1.0, 1, 1, 1])


def test_transformed_multiplies_columns_in_float64():
    matrix = np.array([[0, -1, 0, 5], [2, 0, 0, 6], [0, 0, 3, 7], [0, 0, 0, 1]])
    mesh = ab.Mesh(np.array([(1, 2, 3)] * 3, np.float32)).transformed(matrix)
    assert mesh.positions.dtype == np.float64
    np.testing.assert_array_equal(mesh.positions, [(3, 8, 16)] * 3)


def test_transformed_keeps_faces_and_colours():
    mesh = ab.Mesh(SQUARE, TWO, np.eye(4), name="a").transformed(MIRROR)
    np.testing.assert_array_equal(mesh.faces, TWO)
    np.testing.assert_array_equal(mesh.colors, np.eye(4))
    assert mesh.name == "a"


@pytest.mark.parametrize(
    ("matrix", "message"),
    [
        (np.eye(3), r"transform must have shape \(4, 4\), got \(3, 3\)"),
        (np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [5, 0, 0, 1]]), "last row .*transposed"),
        (np.full((4, 4), np.nan), "transform must be finite"),
        ("turn", "transform must be a matrix of numbers, got str"),
    ],
)
def test_transforms_that_are_refused(matrix, message):
    with pytest.raises(ab.ParameterError, match=message):
        ab.Mesh(TRIANGLE).transformed(matrix)


def test_a_transform_that_overflows_names_the_position():
    with pytest.raises(ab.SceneError, match=r"positions\[1, 0\] is inf"):
        ab.Mesh(np.array(TRIANGLE) * 1e200).transformed(np.diag([1e200, 1, 1, 1]))


@pytest.mark.parametrize("cull", ["back", "front"])
@pytest.mark.parametrize("matrix", [np.eye(4), MIRROR], ids=["plain", "mirrored"])
def test_a_mirrored_mesh_shows_the_same_side(cull, matrix):
    """A counter-clockwise triangle seen from the front is there unless fronts are culled, mirrored or not."""
    camera = ab.Camera.orthographic((0, 0, 5), (0, 0, 0), height=4)
    mesh = ab.Mesh(np.array(TRIANGLE) * 2 - 0.5, cull=cull).transformed(matrix)
    counts = ab.render(mesh, camera, width=32, height=32, device="cpu", fragments="count").counts
    assert (counts.sum() > 0) == (cull == "back")


matrices = st.lists(st.floats(-10, 10), min_size=12, max_size=12).map(
    lambda v: np.array([*v, 0, 0, 0, 1], float).reshape(4, 4)
)


@settings(derandomize=True, deadline=None)
@given(matrices, matrices)
def test_transforms_chain(first, second):
    mesh = ab.Mesh(SQUARE, TWO, cull="back")
    chained = mesh.transformed(first).transformed(second)
    at_once = mesh.transformed(second @ first)
    # Sums of at most 4 products, twice, of numbers up to 440: a few roundings of each.
    np.testing.assert_allclose(chained.positions, at_once.positions, rtol=0, atol=5000 * 16 * 2**-53)


# whose arrays they are


def test_a_read_only_view_of_a_writeable_array_is_copied():
    base = np.array(TRIANGLE)
    view = base.view()
    view.flags.writeable = False
    mesh = ab.Mesh(view)
    base[0] = np.nan
    assert np.isfinite(mesh.positions).all()
    assert ab.render(mesh, width=4, height=4, device="cpu").stats.rejected_triangles == 0


def test_a_read_only_array_is_shared_and_so_are_a_meshs_own():
    given = np.array(TRIANGLE)
    given.flags.writeable = False
    mesh = ab.Mesh(given)
    assert np.shares_memory(mesh.positions, given)
    assert np.shares_memory(mesh.replaced(alpha=0.5).positions, given)
    triangles = ab.Mesh(np.array([TRIANGLE]))
    assert np.shares_memory(triangles.replaced(alpha=0.5).positions, triangles.positions)


def test_a_meshs_arrays_cannot_be_made_writeable():
    mesh = ab.Mesh(np.array([TRIANGLE]), colors=(1, 0, 0))
    for array in (mesh.positions, mesh.colors):
        with pytest.raises(ValueError, match="WRITEABLE"):
            array.flags.writeable = True


def unaligned(array):
    """The same numbers, one byte off."""
    array = np.asarray(array)
    raw = np.zeros(array.nbytes + 1, np.uint8)
    odd = raw[1:].view(array.dtype).reshape(array.shape)
    odd[...] = array
    for each in (raw, odd):
        each.flags.writeable = False
    assert not odd.flags.aligned
    return odd


def test_arrays_that_are_not_aligned_or_not_contiguous_do():
    positions, colors = np.array(SQUARE, np.float64), np.random.default_rng(0).random((4, 4))
    expected = ab.Mesh(positions, TWO, colors)
    for change in (unaligned, np.asfortranarray, lambda a: np.repeat(a, 2, axis=1)[:, ::2]):
        mesh = ab.Mesh(change(positions), change(np.array(TWO)), change(colors))
        for field in ("positions", "faces", "colors"):
            array = getattr(mesh, field)
            assert array.flags.aligned and array.flags.c_contiguous
            np.testing.assert_array_equal(array, getattr(expected, field))
    behind = np.random.default_rng(1).random((6, 8, 4))
    image, odd = (
        ab.render(ab.Scene(), width=8, height=6, device="cpu", precision="float64", background=b).image
        for b in (behind, unaligned(behind))
    )
    np.testing.assert_array_equal(odd, image)
