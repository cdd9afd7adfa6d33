"""Where cameras put points: closed forms, one convention against another, and what is refused."""

import copy
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import abuffer as ab
import scenes

POINTS = np.random.default_rng(0).uniform(-1, 1, (50, 3))
EYE, TARGET = np.array((1.0, 2.0, 5.0)), np.array((0.5, 0.0, -1.0))
CLOSE = {"rtol": 1e-12, "atol": 1e-10}  # pixels and depths of order 100 through a few products in float64


def assert_same(camera, other, width=160, height=120):
    for ours, theirs in zip(camera.project(POINTS, width, height), other.project(POINTS, width, height), strict=True):
        np.testing.assert_allclose(ours, theirs, **CLOSE)


def test_assert_same_tells_cameras_apart():
    with pytest.raises(AssertionError):
        assert_same(ab.Camera.look_at(EYE, TARGET), ab.Camera.look_at(EYE, TARGET + (0, 1e-6, 0)))


# project


def test_project_gives_pixels_down_and_eye_depth():
    """fov 90: at depth d the image is 2d high, so a unit at depth 2 is a quarter of the height."""
    camera = ab.Camera.look_at((0, 0, 5), (0, 0, 0), fov_y=90)
    xy, depth = camera.project([(0, 0, 3), (1, 0, 3), (0, 1, 3), (2, 2, 3)], 200, 100)
    np.testing.assert_allclose(xy, [(100, 50), (125, 50), (100, 25), (150, 0)], rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(depth, 2)
    assert (xy.dtype, depth.dtype) == (np.float64, np.float64)


def test_an_orthographic_size_does_not_depend_on_depth():
    camera = ab.Camera.orthographic((0, 0, 5), (0, 0, 0), height=4)
    xy, depth = camera.project([(1, 1, 3), (1, 1, -30), (1, 1, 8)], 200, 100)
    np.testing.assert_allclose(xy, [(125, 25)] * 3, rtol=1e-12)
    np.testing.assert_allclose(depth, [2, 35, -3], rtol=1e-12)


def test_points_behind_a_perspective_have_no_place():
    xy, depth = ab.Camera.look_at((0, 0, 5), (0, 0, 0)).project([(0, 0, 6), (0, 0, 5)], 10, 10)
    assert np.isnan(xy).all()
    np.testing.assert_array_equal(depth, [-1, 0])


def test_project_takes_no_points():
    xy, depth = ab.Camera.look_at(EYE, TARGET).project(np.zeros((0, 3)), 10, 10)
    assert (xy.shape, depth.shape) == ((0, 2), (0,))


@pytest.mark.parametrize("points", [(0, 0, 0), np.zeros((3, 2)), "points", [(0, 0, 0), (1,)]])
def test_project_refuses_what_is_no_list_of_points(points):
    with pytest.raises(ab.ParameterError, match="points"):
        ab.Camera.look_at(EYE, TARGET).project(points, 10, 10)


@pytest.mark.parametrize("size", [(0, 10), (10, 10.0), (10, True), (20000, 10)])
def test_sizes_are_pixels(size):
    with pytest.raises(ab.ParameterError, match="must be an integer from 1 to 16384 pixels"):
        ab.Camera.look_at(EYE, TARGET).project(POINTS, *size)


def test_project_agrees_with_what_is_rendered():
    """The pixels of a triangle of a few pixels have their centres in its projected box."""
    camera = ab.Camera.look_at(EYE, TARGET, fov_y=50)
    corner = np.array([(0.11, 0.03, 0.0), (-0.08, 0.09, 0.01), (-0.06, -0.12, 0.0)])
    for offset in POINTS[:8]:
        triangle = corner + offset
        xy, _ = camera.project(triangle, 160, 120)
        counts = ab.render(ab.Mesh(triangle), camera, width=160, height=120, device="cpu", fragments="count").counts
        y, x = np.nonzero(counts)
        low, high = xy.min(axis=0), xy.max(axis=0)
        assert len(x) >= 1
        snapped = 1 / 256
        assert (x + 0.5 >= low[0] - snapped).all() and (x + 0.5 <= high[0] + snapped).all()
        assert (y + 0.5 >= low[1] - snapped).all() and (y + 0.5 <= high[1] + snapped).all()


# conventions agree


@pytest.mark.parametrize("aspect", [0.5, 1, 16 / 9])
def test_look_at_is_the_textbooks_matrix(aspect):
    height = 90
    view, projection = scenes.look_at(EYE, TARGET, (0, 1, 0), 37.0, aspect)
    assert_same(ab.Camera.look_at(EYE, TARGET, fov_y=37.0), ab.Camera(view, projection), round(height * aspect), height)


def test_orthographic_is_the_textbooks_matrix():
    view, projection = scenes.orthographic(EYE, TARGET, height=3.0, aspect=4 / 3)
    assert_same(ab.Camera.orthographic(EYE, TARGET, height=3.0), ab.Camera(view, projection))


def test_from_pose_is_the_inverse_of_the_view():
    camera = ab.Camera.look_at(EYE, TARGET, (0.1, 1, 0.3), fov_y=30)
    assert_same(ab.Camera.from_pose(np.linalg.inv(camera.view), fov_y=30), camera)


def intrinsics(focal, width, height, pixel_center):
    """K of a camera whose axis meets the image's middle."""
    middle = np.array((width, height)) / 2 - 0.5 + pixel_center
    return np.array([(focal, 0, middle[0]), (0, focal, middle[1]), (0, 0, 1.0)])


@pytest.mark.parametrize("pixel_center", [0.0, 0.5])
def test_from_intrinsics_is_look_at_turned_to_opencv(pixel_center):
    camera = ab.Camera.look_at(EYE, TARGET, fov_y=40)
    focal = 60 / np.tan(np.radians(20))
    world_to_camera = np.diag([1, -1, -1, 1]) @ camera.view
    for extrinsics in (world_to_camera, world_to_camera[:3]):
        other = ab.Camera.from_intrinsics(
            intrinsics(focal, 160, 120, pixel_center), extrinsics, width=160, height=120, pixel_center=pixel_center
        )
        assert_same(other, camera)


@pytest.mark.parametrize("pixel_center", [0.0, 0.5])
def test_from_intrinsics_is_the_pinhole_formula(pixel_center):
    """u = (fx X + s Y)/Z + cx in K's own pixel coordinates; ours have the first centre at 0.5."""
    k = np.array([(150.0, 3.0, 70.0), (0, 140.0, 65.0), (0, 0, 1)])
    angle = 0.3
    extrinsics = np.array(
        [(np.cos(angle), 0, np.sin(angle), 0.1), (0, 1, 0, -0.2), (-np.sin(angle), 0, np.cos(angle), 4)]
    )
    camera = ab.Camera.from_intrinsics(k, extrinsics, width=160, height=120, pixel_center=pixel_center)
    eye = POINTS @ extrinsics[:, :3].T + extrinsics[:, 3]
    pixels = eye @ k.T
    xy, depth = camera.project(POINTS, 160, 120)
    np.testing.assert_allclose(xy, pixels[:, :2] / pixels[:, 2:] - pixel_center + 0.5, **CLOSE)
    np.testing.assert_allclose(depth, eye[:, 2], **CLOSE)


def test_from_intrinsics_brings_its_size():
    camera = ab.Camera.from_intrinsics(
        intrinsics(50, 40, 30, 0), np.eye(4), width=np.int64(40), height=30, pixel_center=0
    )
    assert ab.render(ab.Scene(), camera, device="cpu").image.shape == (30, 40, 4)
    assert ab.render(ab.Scene(), camera, width=80, height=60, device="cpu").image.shape == (60, 80, 4)
    with pytest.raises(ab.ParameterError, match="aspect"):
        ab.render(ab.Scene(), camera, width=30, height=40, device="cpu")


@pytest.mark.parametrize(
    ("k", "extrinsics", "message"),
    [
        (np.eye(4), np.eye(4), r"K must have shape \(3, 3\)"),
        (np.eye(3)[::-1], np.eye(4), "K must be .*fx, s, cx"),
        (np.diag([1.0, -1, 1]), np.eye(4), "fx, fy > 0"),
        (np.eye(3), np.eye(3), r"world_to_camera must have shape \(3, 4\) or \(4, 4\), got \(3, 3\)"),
        (np.eye(3), np.eye(4)[[0, 1, 3, 2]], "world_to_camera"),
        (np.eye(3), np.diag([1.0, 1, 0, 1]), "world_to_camera is singular"),
    ],
)
def test_intrinsics_that_are_refused(k, extrinsics, message):
    with pytest.raises(ab.ParameterError, match=message):
        ab.Camera.from_intrinsics(k, extrinsics, width=40, height=30)


# near and far of projections


def perspective_row(near, far, clip_z):
    """a, b of z_clip = a z + b from w_clip = −z: clip_z[0] at near, clip_z[1] at far; far may be inf."""
    at_near, at_far = clip_z
    if far == np.inf:
        return -at_far, -near * (at_far - at_near)
    slope = (at_far * far - at_near * near) / (far - near)
    return -slope, near * (at_near - slope)


def camera_with_row(row, last, clip_z):
    projection = np.array([(1, 0, 0, 0), (0, 1, 0, 0), (0, 0, *row), last], float)
    return ab.Camera(np.eye(4), projection, clip_z=clip_z)


@pytest.mark.parametrize("clip_z", [(0, 1), (-1, 1)])
@pytest.mark.parametrize("reversed_z", [False, True])
@pytest.mark.parametrize(("near", "far"), [(0.1, 100.0), (0.5, np.inf), (1e-3, 7.0)])
def test_near_and_far_are_found_in_a_perspective(clip_z, reversed_z, near, far):
    row = perspective_row(near, far, clip_z[::-1] if reversed_z else clip_z)
    camera = camera_with_row(row, (0, 0, -1, 0), clip_z)
    # far comes from a difference that cancels: its relative error is 2^-53 · far/near times a few.
    assert camera.near == pytest.approx(near, rel=1e-12)
    assert camera.far == (None if far == np.inf else pytest.approx(far, rel=1e-10))


def test_near_and_far_of_the_opengl_matrix():
    """As gluPerspective builds it."""
    near, far = 0.25, 50.0
    row = (far + near) / (near - far), 2 * far * near / (near - far)
    camera = camera_with_row(row, (0, 0, -1, 0), (-1, 1))
    assert (camera.near, camera.far) == (pytest.approx(near), pytest.approx(far))
    wrong = camera_with_row(row, (0, 0, -1, 0), (0, 1))
    assert wrong.near != pytest.approx(near, rel=0.1)  # clip_z does matter


@pytest.mark.parametrize("clip_z", [(0, 1), (-1, 1)])
@pytest.mark.parametrize("reversed_z", [False, True])
@pytest.mark.parametrize(("near", "far"), [(0.0, 10.0), (-5.0, 20.0), (1.0, 3.0)])
def test_near_and_far_are_found_in_a_parallel_projection(clip_z, reversed_z, near, far):
    low, high = clip_z[::-1] if reversed_z else clip_z
    slope = (high - low) / (far - near)
    camera = camera_with_row((-slope, low - slope * near), (0, 0, 0, 1), clip_z)
    assert camera.near == pytest.approx(near, abs=1e-12)
    assert camera.far == pytest.approx(far, rel=1e-12)


def test_a_constant_clip_z_cuts_nothing():
    """z_clip = w/2 keeps every depth under both conventions."""
    for clip_z in ((0, 1), (-1, 1)):
        camera = camera_with_row((-0.5, 0), (0, 0, -1, 0), clip_z)
        assert (camera.near, camera.far) == (None, None)


@pytest.mark.parametrize("near_far", [(None, None), (0.5, None), (None, 9.0), (0.5, 9.0), (0.5, np.inf)])
@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
def test_matrices_give_the_same_camera_again(kind, near_far):
    near, far = near_far
    make = ab.Camera.look_at if kind == "perspective" else ab.Camera.orthographic
    camera = make(EYE, TARGET, near=near, far=far, **({} if kind == "perspective" else {"height": 3}))
    again = ab.Camera(*camera.matrices(160, 120))
    assert_same(again, camera)
    if near is not None:
        assert again.near == pytest.approx(near, rel=1e-9)
    if camera.far is not None:
        assert again.far == pytest.approx(far, rel=1e-9)


def layers_seen(camera, depths):
    """Which of flat layers at these eye depths a camera at the origin, looking along −Z, lists."""
    size = 1000.0
    stack = [ab.Mesh([(-size, -size, -d), (size, -size, -d), (0, size, -d)]) for d in depths]
    # float64, in which positions relative to the middle of the scene still tell 1e-9 from 0.
    options = {"device": "cpu", "precision": "float64", "fragments": True}
    frags = ab.render(stack, camera, width=3, height=3, **options).fragments
    return sorted(frags[1, 1].primitive.tolist())


@pytest.mark.parametrize("kind", ["look_at", "orthographic", "opengl"])
def test_near_and_far_cut_what_is_drawn(kind):
    if kind == "look_at":
        camera = ab.Camera.look_at((0, 0, 0), (0, 0, -1), near=1, far=10)
    elif kind == "orthographic":
        camera = ab.Camera.orthographic((0, 0, 0), (0, 0, -1), height=2, near=1, far=10)
    else:
        camera = camera_with_row(perspective_row(1, 10, (-1, 1)), (0, 0, -1, 0), (-1, 1))
    assert layers_seen(camera, [0.9, 1.1, 9.9, 10.1]) == [1, 2]


def test_without_near_and_far_nothing_in_front_of_the_eye_is_cut():
    camera = ab.Camera.look_at((0, 0, 0), (0, 0, -1))
    assert layers_seen(camera, [1e-9, 1.0, 1e2, -1.0]) == [0, 1, 2]


def test_a_parallel_projection_may_draw_what_is_behind_the_eye():
    depths = [-5.0, 5.0]
    assert layers_seen(ab.Camera.orthographic((0, 0, 0), (0, 0, -1), height=2), depths) == [1]
    assert layers_seen(ab.Camera.orthographic((0, 0, 0), (0, 0, -1), height=2, near=-6), depths) == [0, 1]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"near": 0}, "near must be over 0.*, got 0"),
        ({"near": -1.0}, "near must be over 0"),
        ({"near": "close"}, "near must be a number"),
        ({"far": 0.0}, "far must be over 0"),
        ({"near": 2, "far": 1}, "far must be beyond near, got near=2.0 far=1.0"),
        ({"near": np.inf}, "near"),
        ({"far": np.nan}, "far"),
        ({"fov_y": 0}, "fov_y must be between 0 and 180"),
        ({"fov_y": 180}, "fov_y must be between 0 and 180"),
        ({"fov_y": None}, "fov_y must be a number, got None"),
    ],
)
def test_lenses_that_are_refused(options, message):
    with pytest.raises(ab.ParameterError, match=message):
        ab.Camera.look_at(EYE, TARGET, **options)


@pytest.mark.parametrize("height", [0, -1, np.inf, "2"])
def test_an_orthographic_height_is_positive(height):
    with pytest.raises(ab.ParameterError, match="height must be"):
        ab.Camera.orthographic(EYE, TARGET, height=height)


# directions


@pytest.mark.parametrize(
    ("eye", "target", "up", "message"),
    [
        ((0, 0, 5), (0, 0, 5), (0, 1, 0), "eye and target are the same point"),
        ((0, 5, 0), (0, 0, 0), (0, 1, 0), "up .* is along the view"),
        ((0, 5, 0), (0, 0, 0), (0, -2, 0), "up .* is along the view"),
        ((0, 0, 5), (0, 0, 0), (0, 0, 0), "up must not be zero"),
        ((0, 0), (0, 0, 0), (0, 1, 0), r"eye must have shape \(3,\), got \(2,\)"),
        ((0, 0, 5), (0, 0, np.nan), (0, 1, 0), "target must be finite"),
        ("here", (0, 0, 0), (0, 1, 0), "eye must be a matrix of numbers, got str 'here'"),
        ((0, 0, 1j), (0, 0, 0), (0, 1, 0), "eye must be a matrix of numbers, got tuple"),
    ],
)
def test_directions_that_are_refused(eye, target, up, message):
    with pytest.raises(ab.ParameterError, match=message):
        ab.Camera.look_at(eye, target, up)
    with pytest.raises(ab.ParameterError, match=message):
        ab.Camera.orthographic(eye, target, up, height=1)


@pytest.mark.parametrize("fov_y", [0.8, 3.1])
def test_a_very_narrow_field_of_view_may_be_radians(fov_y):
    makers = [
        lambda: ab.Camera.look_at(EYE, TARGET, fov_y=fov_y),
        lambda: ab.Camera.from_pose(np.eye(4), fov_y=fov_y),
        lambda: ab.Camera.fit(ab.Scene(), fov_y=fov_y),
    ]
    for make in makers:
        with pytest.warns(UserWarning, match="fov_y is in degrees: .* radians") as caught:
            camera = make()
        assert caught[0].filename == __file__
        camera.project(POINTS, 10, 10)  # warns no more


def test_a_narrow_field_of_view_is_not_warned_about():
    ab.Camera.look_at(EYE, TARGET, fov_y=3.2)


# matrices


def test_a_transposed_view_is_refused():
    view, projection = scenes.look_at(EYE, TARGET)
    with pytest.raises(ab.ParameterError, match=r"view's last row .* looks transposed"):
        ab.Camera(view.T, projection)
    with pytest.raises(ab.ParameterError, match=r"camera_to_world's last row .* looks transposed"):
        ab.Camera.from_pose(np.linalg.inv(view).T)


@pytest.mark.parametrize("near", [None, 0.1, 0.5])
def test_a_transposed_projection_is_refused(near):
    view, projection = scenes.look_at(EYE, TARGET, near=near)
    with pytest.raises(ab.ParameterError, match="projection"):
        ab.Camera(view, projection.T)


@pytest.mark.parametrize(
    ("projection", "message"),
    [
        (np.diag([1.0, 1, 1, 2]), r"projection's last row must be \(0, 0, -1, 0\) or \(0, 0, 0, 1\)"),
        ([(1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 1, 0)], "looks along \\+Z: use Camera.from_intrinsics"),
        ([(1, 0, 0, 0), (0, 1, 0, 0), (0.1, 0, 1, 0), (0, 0, -1, 0)], "oblique near plane"),
        ([(1, 1, 0, 0), (1, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)], "one line of the image"),
        (np.zeros((4, 4)), "projection's last row"),
        (np.eye(3), r"projection must have shape \(4, 4\)"),
    ],
)
def test_projections_that_are_refused(projection, message):
    with pytest.raises(ab.ParameterError, match=message):
        ab.Camera(np.eye(4), projection)


def test_a_singular_view_is_refused():
    with pytest.raises(ab.ParameterError, match="view is singular"):
        ab.Camera(np.diag([1.0, 1, 0, 1]), np.eye(4))


@pytest.mark.parametrize("clip_z", [(0, 2), 1, (0,), "near", (1, -1)])
def test_clip_z_has_two_conventions(clip_z):
    with pytest.raises(ab.ParameterError, match=r"clip_z must be \(0, 1\) or \(-1, 1\)"):
        ab.Camera(np.eye(4), np.eye(4), clip_z=clip_z)


def test_another_aspect_is_refused_beyond_a_pixel():
    view, projection = scenes.look_at(EYE, TARGET, aspect=2.0)
    camera = ab.Camera(view, projection)
    for width in (199, 200, 201):
        camera.project(POINTS, width, 100)
    for width in (198, 202):
        with pytest.raises(ab.ParameterError, match=r"aspect ratio is 2, but .* for this height its width is 200"):
            camera.project(POINTS, width, 100)


def test_the_view_given_is_copied():
    view, projection = scenes.look_at(EYE, TARGET)
    camera = ab.Camera(view, projection)
    view[:] = 0
    camera.project(POINTS, 100, 100)


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, lambda c: pickle.loads(pickle.dumps(c))])
def test_copies_are_the_same_camera(copied):
    scene = ab.Scene(ab.Mesh(POINTS[:3]))
    for camera in (
        ab.Camera.look_at(EYE, TARGET, near=0.5),
        ab.Camera.orthographic(EYE, TARGET, height=2),
        ab.Camera.fit(scene),
    ):
        other = copied(camera)
        assert_same(other, camera)
        assert (other.near, other.far) == (camera.near, camera.far)


# fit

directions = st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 1e-3)


@settings(derandomize=True, deadline=None, max_examples=200)
@given(
    azimuth=st.floats(-400, 400),
    elevation=st.floats(-180, 180),
    up=directions,
    fov_y=st.floats(5, 170),
    width=st.integers(20, 400),
    height=st.integers(20, 400),
)
def test_the_whole_sphere_is_in_the_picture_and_fills_it(azimuth, elevation, up, fov_y, width, height):
    sphere, faces = scenes.icosphere(2)
    middle = np.array((3.0, -1.0, 2.0))
    scene = ab.Scene(ab.Mesh(sphere + middle, faces))
    camera = ab.Camera.fit(scene, azimuth=azimuth, elevation=elevation, up=up, fov_y=fov_y, margin=1.0)
    xy, depth = camera.project(sphere + middle, width, height)
    assert (depth > 0).all()
    assert xy.min() >= -1e-6
    assert (xy <= np.array((width, height)) + 1e-6).all()
    (center,), _ = camera.project([middle], width, height)
    np.testing.assert_allclose(center, (width / 2, height / 2), atol=1e-6)
    # The distance is what the smaller field of view says: sin(half) = radius / distance.
    half = np.radians(fov_y) / 2
    half = min(half, np.arctan(np.tan(half) * width / height))
    _, (distance,) = camera.project([middle], width, height)
    assert distance == pytest.approx(1 / np.sin(half), rel=1e-6)


def test_margin_steps_back():
    scene = ab.Scene(ab.Mesh(POINTS[:3]))
    middle = [scene.bounds.mean(axis=0)]
    near, far = (ab.Camera.fit(scene, margin=m).project(middle, 100, 100)[1][0] for m in (1, 1.05))
    assert far == pytest.approx(1.05 * near)


@pytest.mark.parametrize(
    ("azimuth", "elevation", "up", "forward", "screen_up"),
    [
        (0, 0, (0, 1, 0), (0, 0, -1), (0, 1, 0)),
        (90, 0, (0, 1, 0), (-1, 0, 0), (0, 1, 0)),
        (0, 90, (0, 1, 0), (0, -1, 0), (0, 0, -1)),
        (90, 90, (0, 1, 0), (0, -1, 0), (-1, 0, 0)),
        (0, -90, (0, 1, 0), (0, 1, 0), (0, 0, 1)),
        (0, 0, (0, 0, 1), (0, 1, 0), (0, 0, 1)),
        (90, 0, (0, 0, 1), (-1, 0, 0), (0, 0, 1)),
        (0, 0, (0, -3, 0), (0, 0, 1), (0, -1, 0)),
    ],
)
def test_azimuth_and_elevation(azimuth, elevation, up, forward, screen_up):
    view = ab.Camera.fit(ab.Scene(ab.Mesh(POINTS[:3])), azimuth=azimuth, elevation=elevation, up=up).view
    np.testing.assert_allclose(-view[2, :3], forward, atol=1e-12)
    np.testing.assert_allclose(view[1, :3], screen_up, atol=1e-12)


def test_fit_counts_what_is_added_later():
    scene = ab.Scene(ab.Mesh(POINTS[:3]))
    camera = ab.Camera.fit(scene)
    scene.add(ab.Mesh(POINTS[:3] + 100))
    assert_same(camera, ab.Camera.fit(scene))


def test_fit_takes_what_a_scene_takes():
    mesh = ab.Mesh(POINTS[:3])
    assert_same(ab.Camera.fit(mesh), ab.Camera.fit(ab.Scene([mesh])))
    with pytest.raises(ab.SceneError, match="cannot add this int"):
        ab.Camera.fit(3)


def test_fit_of_nothing_and_of_a_point_frames_the_unit_sphere():
    empty = ab.Camera.fit(ab.Scene())
    assert_same(empty, ab.Camera.fit(ab.Mesh(np.zeros((3, 3)))))
    assert ab.render(ab.Scene(), width=8, height=4, device="cpu").image.shape == (4, 8, 4)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"up": (0, 0, 0)}, "up must not be zero"),
        ({"up": "z"}, "up must be"),
        ({"azimuth": np.inf}, "azimuth must be finite"),
        ({"margin": 0}, "margin must be over 0"),
        ({"fov_y": 200}, "fov_y must be between"),
    ],
)
def test_fits_that_are_refused_at_once(options, message):
    with pytest.raises(ab.ParameterError, match=message):
        ab.Camera.fit(ab.Scene(), **options)


# what a camera must be


def matrices_of(kind, linear):
    """A call that makes a camera whose 4×4 has this upper 3×3."""
    m = np.eye(4)
    m[:3, :3], m[:3, 3] = linear, (0.1, 0.2, 0.3)
    if kind == "view":
        return lambda: ab.Camera(m, np.diag([1.0, 1, -1, 1]))
    if kind == "camera_to_world":
        return lambda: ab.Camera.from_pose(m)
    return lambda: ab.Camera.from_intrinsics(np.diag([50.0, 50, 1]), m, width=40, height=30)


ROTATION = ab.Camera.look_at(EYE, TARGET).view[:3, :3]


@pytest.mark.parametrize("kind", ["view", "camera_to_world", "world_to_camera"])
@pytest.mark.parametrize(
    ("change", "message"),
    [
        (np.eye(3) * 2.5, r"has the scale 2\.5, .* depth is in world units: divide its first three (columns|rows)"),
        (np.eye(3) * 1e-200, "has the scale 1e-200"),
        (np.diag([1.0, 1, 1 + 1e-4]), r"has the scale \(.*1\.0001\), .* by their scales"),
        (np.diag([1.0, 1, -1]), "is mirrored"),
        (np.array([(1, 0.1, 0), (0, 1, 0), (0, 0, 1.0)]), "is sheared"),
    ],
)
def test_what_is_no_rotation_is_refused(kind, change, message):
    linear = ROTATION @ change if kind == "camera_to_world" else change @ ROTATION
    with pytest.raises(ab.ParameterError, match=f"^{kind} {message}"):
        matrices_of(kind, linear)()


@pytest.mark.parametrize("kind", ["view", "camera_to_world", "world_to_camera"])
def test_a_rotation_in_float32_is_one(kind):
    matrices_of(kind, ROTATION.astype(np.float32))()
    matrices_of(kind, (ROTATION.astype(np.float32) @ ROTATION.astype(np.float32)))()


def test_the_scale_is_mended_as_the_message_says():
    """A pose by its columns; a view, which is its inverse, by its rows with the translation."""
    camera = ab.Camera.look_at(EYE, TARGET)
    pose = np.linalg.inv(camera.view)
    scaled = pose @ np.diag([2.0, 2, 2, 1])
    mended = scaled.copy()
    mended[:, :3] /= 2
    assert_same(ab.Camera.from_pose(mended), camera)
    view = np.linalg.inv(scaled)
    view[:3] /= 0.5
    np.testing.assert_allclose(view, camera.view, **CLOSE)


@pytest.mark.parametrize("make", [lambda: ab.Camera.look_at(EYE, TARGET), lambda: ab.Camera.fit(ab.Scene())])
def test_a_camera_is_read_only(make):
    camera = make()
    for field in ("view", "near", "far", "_aspect", "other"):
        with pytest.raises(AttributeError, match=f"a Camera is read-only: make another with another {field}"):
            setattr(camera, field, 1)
    with pytest.raises(AttributeError):
        del camera._size
    with pytest.raises(ValueError, match="read-only"):
        camera.view[0, 0] = 2
