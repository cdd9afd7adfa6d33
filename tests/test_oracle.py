"""The reference against closed forms and against a second, cruder implementation; nothing of the package is needed."""

import numpy as np
import pytest

import scenes
from oracle import OracleCamera, U, colour_bound, composite, edge_distance, hull, near_tie_pixels, trace

ROUNDING = 1e-12  # float64 (1e-16) times the condition of these scenes' planes, with room


def front(near=None, far=None, aspect=1.0):
    return OracleCamera(*scenes.front_camera(aspect, near, far), near, far)


def flat(color, n=1):
    return np.broadcast_to(np.asarray(color, float), (n, 3, 4)).copy()


def quad(z=0.0, half=0.8, dx=0.0, dy=0.0):
    a, b, c, d = ((x * half + dx, y * half + dy, z) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1)))
    return np.array([(a, b, c), (a, c, d)])


def pixel_hits(hits, p):
    return slice(hits.offsets[p], hits.offsets[p + 1])


@pytest.mark.parametrize("dx", [0.0, 1 / 32, 0.0123])
@pytest.mark.parametrize("size", [(64, 64), (65, 65), (64, 48)])
def test_quad_has_no_seam(size, dx):
    """The diagonal runs through pixel centres where dx is 0, and a vertex of four quads lies on one at 65x65."""
    width, height = size
    corners = [quad(0, 0.4, x + dx, y) for x in (-0.4, 0.4) for y in (-0.4, 0.4)]
    hits = trace(np.concatenate(corners), flat((1, 1, 1, 0.5), 8), front(aspect=width / height), width, height)
    assert set(np.unique(hits.counts)) == {0, 1}
    extent = height * 0.8 / (3 * np.tan(np.pi / 8))  # edge length of the whole in pixels
    assert abs(hits.counts.sum() - extent**2) <= 2 * extent + 2  # half a row and half a column at each border


def test_centre_ray_through_shared_vertex_is_hit_once():
    fan = np.array(
        [[(0, 0, 0), (np.cos(t), np.sin(t), 0.2), (np.cos(t + 0.7), np.sin(t + 0.7), 0.2)] for t in np.arange(9) * 0.7]
    )
    fan[:, 2] = np.roll(fan[:, 1], -1, axis=0)  # closed, shared corners equal bit by bit
    hits = trace(fan, flat((1, 1, 1, 0.5), 9), front(), 33, 33)
    assert hits.counts[16, 16] == 1


@pytest.mark.parametrize("scene", [scenes.nested_icospheres(4, 3), scenes.bumpy_sphere()], ids=["spheres", "bumpy"])
@pytest.mark.parametrize("size", [96, 97])
def test_closed_surface_has_even_counts(scene, size):
    hits = trace(*scene, front(), size, size)
    assert hits.counts.max() >= 4
    assert not (hits.counts % 2).any()
    missing_one = np.arange(len(scene[0])) != hits.primitive[0]
    assert (trace(scene[0][missing_one], scene[1][missing_one], front(), size, size).counts % 2).any()


@pytest.mark.parametrize("n, alpha", [(0, 0.5), (1, 0.0), (2, 1.0), (10, 0.3), (300, 0.01), (1000, 1e-4)])
def test_equal_layers(n, alpha):
    triangles, colors = scenes.layers(n, alpha)
    colors[..., :3] = (1, 0.5, 0)
    hits = trace(triangles, colors, front(), 8, 8)
    assert (hits.counts == n).all()
    assert (np.diff(hits.depth.reshape(64, n), axis=1) > 1e-4).all()
    alpha = colors[0, 0, 3] if n else 0.0
    cover = -np.expm1(n * np.log1p(-alpha)) if alpha < 1 else 1.0
    expected = cover * np.array([1, 0.5, 0, 1]) + (1 - cover) * np.array([0, 0.25 * 0.5, 0.5 * 0.5, 0.5])
    np.testing.assert_allclose(
        composite(hits, (0, 0.25, 0.5, 0.5)), np.broadcast_to(expected, (8, 8, 4)), atol=ROUNDING
    )


def plane_rays(size):
    """Depth, x and y where the rays of `front` meet the plane z = 0.3 x - 0.2 y + 0.1: by hand."""
    ndc = 2 * (np.arange(size) + 0.5) / size - 1
    x, y = np.meshgrid(ndc * np.tan(np.pi / 8), -ndc * np.tan(np.pi / 8))
    depth = 2.9 / (1 + 0.3 * x - 0.2 * y)  # 3 - depth = 0.3 x depth - 0.2 y depth + 0.1
    return depth, x * depth, y * depth


def slanted():
    """Colours (3, 4) affine in x and y, and corners (3, 3), of a triangle in that plane which covers the image."""
    corners = np.array([(-9, -8, 0), (9, -8, 0), (0.5, 12, 0.0)])
    corners[:, 2] = 0.3 * corners[:, 0] - 0.2 * corners[:, 1] + 0.1
    return corners[:, :2] @ np.array([[0.02, 0.0, 0.01, 0.0], [0, 0.03, 0.01, 0.02]]) + (0.5, 0.4, 0.5, 0.5), corners


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 0, 1), (2, 1, 0)])
def test_slanted_plane_is_analytic(order):
    colors, corners = slanted()
    hits = trace(corners[None, order], colors[None, order], front(), 48, 48)
    depth, x, y = plane_rays(48)
    assert (hits.counts == 1).all()
    np.testing.assert_allclose(hits.depth.reshape(48, 48), depth, rtol=ROUNDING)
    expected = np.stack([0.5 + 0.02 * x, 0.4 + 0.03 * y, 0.5 + 0.01 * (x + y), 0.5 + 0.02 * y], -1)
    np.testing.assert_allclose(hits.color.reshape(48, 48, 4), expected, rtol=ROUNDING)


@pytest.mark.parametrize("perspective", [True, False])
def test_gradients_are_derivatives(perspective):
    """Against the difference to a camera whose image is moved by 1e-4 px."""
    colors, corners = slanted()
    camera = front() if perspective else OracleCamera(*scenes.orthographic((0, 0, 3), (0, 0, 0), height=2.0))
    at, step = trace(corners[None], colors[None], camera, 16, 16), 1e-4
    color, depth = [], []
    for axis in (0, 1):
        moved = camera.projection.copy()
        moved[axis] += step * 2 / 16 * camera.projection[3]  # adds to ndc; the direction does not matter
        there = trace(corners[None], colors[None], OracleCamera(camera.view, moved), 16, 16)
        color.append(np.abs(there.color - at.color) / step)
        depth.append(np.abs(there.depth - at.depth) / step)
    # A one-sided difference is off by half the second derivative times the step, far below 1e-3 of the first.
    np.testing.assert_allclose(at.gradient, np.max(color, axis=0), rtol=1e-3, atol=1e-8)
    np.testing.assert_allclose(at.depth_gradient, np.max(depth, axis=0), rtol=1e-3, atol=1e-8)


@pytest.mark.parametrize("near, far", [(None, None), (0.5, None), (0.5, 3.2)])
def test_near_crossing_equals_its_pieces(near, far):
    triangles, colors = scenes.near_crossing()

    def split(v):
        a, b, c = np.moveaxis(v, 1, 0)
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        return np.stack([np.stack(t, 1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))], 1).reshape(
            -1, *v.shape[1:]
        )

    camera = front(near, far)
    whole = trace(triangles, colors, camera, 64, 64)
    parts = trace(split(split(triangles)), split(split(colors)), camera, 64, 64)
    assert set(whole.primitive) == {0, 1, 2, 3}
    np.testing.assert_array_equal(whole.counts, parts.counts)
    np.testing.assert_array_equal(whole.primitive, parts.primitive // 16)
    np.testing.assert_allclose(whole.depth, parts.depth, rtol=ROUNDING)
    np.testing.assert_allclose(
        whole.color, parts.color, atol=1e-10
    )  # near the eye a colour changes fast with the plane
    assert whole.depth.min() >= (near or 0)
    assert whole.depth.max() <= (far or np.inf)


def brute(triangles, colors, camera, width, height, pixel):
    """Möller-Trumbore for one pixel, all triangles, with the ray from the inverse of view and projection."""
    inverse = np.linalg.inv(camera.projection @ camera.view)
    ndc = 2 * (pixel % width + 0.5) / width - 1, 1 - 2 * (pixel // width + 0.5) / height
    p, q = (inverse @ (*ndc, z, 1) for z in (0.25, 0.75))
    origin, direction = p[:3] / p[3], q[:3] / q[3] - p[:3] / p[3]
    e1, e2 = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    h = np.cross(direction, e2)
    det = (e1 * h).sum(-1)
    s = origin - triangles[:, 0]
    k = np.cross(s, e1)
    u, v, t = (s * h).sum(-1) / det, (k @ direction) / det, (k * e2).sum(-1) / det
    depth = -(camera.view[2, :3] @ (origin[:, None] + t * direction[:, None]) + camera.view[2, 3])
    hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (depth >= (camera.near or 0)) & (depth <= (camera.far or np.inf))
    order = np.flatnonzero(hit)[np.argsort(depth[hit])]
    u, v = u[order, None], v[order, None]
    return order, depth[order], (1 - u - v) * colors[order, 0] + u * colors[order, 1] + v * colors[order, 2]


@pytest.mark.parametrize("kind", ["perspective", "tilted", "off-centre", "orthographic", "near", "far away"])
def test_against_brute_force(kind):
    near, far = (2.9, 3.3) if kind == "near" else (0.1, 100.0)
    triangles, colors = scenes.random_triangles(500, 0.3, 11)
    tail = (0.8, near, far)
    make = {
        "perspective": scenes.front_camera(*tail),
        "near": scenes.front_camera(*tail),
        "off-centre": scenes.front_camera(*tail),
        "tilted": scenes.look_at((0.2, 0.1, 0.3), (-1, 2, -0.5), (1, 1, 0), 70, *tail),
        "far away": scenes.look_at((1e4, 1e4, 1e4 + 3), (1e4, 1e4, 1e4), (0, 1, 0), 45, *tail),
        "orthographic": scenes.orthographic((1, 1, 2), (0, 0.1, 0), (0, 1, 0), 1.5, *tail),
    }[kind]
    if kind == "off-centre":
        make[1][:2, 1:3] += (0.2, 0.15), (0, -0.1)  # skew, and a principal point away from the middle
    moved = triangles + (1e4 if kind == "far away" else 0)
    camera = OracleCamera(*make, near, far)
    hits = trace(moved, colors, camera, 40, 50)
    found = 0
    for pixel in np.random.default_rng(1).choice(2000, 300, replace=False):
        order, depth, color = brute(moved, colors, camera, 40, 50, pixel)
        mine = pixel_hits(hits, pixel)
        np.testing.assert_array_equal(hits.primitive[mine], order)
        np.testing.assert_allclose(
            hits.depth[mine], depth, rtol=1e-7
        )  # inverse(projection @ view) is the crude side here
        np.testing.assert_allclose(hits.color[mine], color, atol=1e-6)
        found += len(order)
    assert found > 200
    moved[hits.primitive[0], 0] += 0.05  # negative control: one vertex off is noticed
    other = trace(moved, colors, camera, 40, 50)
    assert len(other.depth) != len(hits.depth) or np.abs(other.depth - hits.depth).max() > 1e-4


def test_far_from_origin_equals_scene_at_origin():
    triangles, colors = scenes.far_from_origin(1e6)
    here = trace(triangles - 1e6, colors, front(), 64, 64)
    there = trace(triangles, colors, OracleCamera(*scenes.look_at((1e6, 1e6, 1e6 + 3), (1e6, 1e6, 1e6))), 64, 64)
    np.testing.assert_array_equal(here.primitive, there.primitive)
    np.testing.assert_allclose(
        here.depth, there.depth, rtol=1e-7
    )  # 1e6 in float64: 1e-10, times the steepness of triangles


def test_opaque_hides_and_becomes_background():
    triangles = np.concatenate([quad(0.2), quad(0.0, 0.5), quad(-0.3), quad(0.0, 0.5)])
    colors = np.concatenate([flat(c, 2) for c in ((1, 0, 0, 0.5), (0, 1, 0, 0.25), (0, 0, 1, 0.5), (1, 1, 0, 0.5))])
    opaque = np.array([0, 0, 1, 1, 0, 0, 0, 0], bool)  # green; yellow lies exactly on it and stays, blue is behind it
    hits = trace(triangles, colors, front(), 32, 32, opaque=opaque)
    assert hits.primitive[pixel_hits(hits, 16 * 32 + 16)].tolist() in ([0, 6], [1, 7])
    np.testing.assert_array_equal(hits.background[16, 16], (0, 1, 0, 1))
    np.testing.assert_allclose(composite(hits, (9, 9, 9, 1))[16, 16], (0.5 + 0.25, 0.25 + 0.25, 0, 1), atol=ROUNDING)
    assert 4 in hits.primitive or 5 in hits.primitive  # blue shows around it
    assert not near_tie_pixels(hits).any()
    opaque[6:] = True  # both opaque: the later wins
    np.testing.assert_array_equal(
        trace(triangles, colors, front(), 32, 32, opaque=opaque).background[16, 16], (1, 1, 0, 1)
    )
    close = triangles.copy()
    close[6:, :, 2] += 1e-6
    hits = trace(close, colors, front(), 32, 32, opaque=opaque)
    assert near_tie_pixels(hits)[16, 16]
    assert np.isinf(hull(hits)[0][16, 16]).all()


def test_duplicates_tie_exactly_and_later_is_in_front():
    triangles, colors = scenes.duplicates(12)
    view = scenes.look_at((1.1, 0.7, 2.3), (0.1, 0, 0))
    hits = trace(triangles, colors, OracleCamera(*view), 64, 64)
    assert len(hits.depth) > 1000
    four = hits.primitive.reshape(-1, 4)
    np.testing.assert_array_equal(four % 12, np.repeat(four[:, :1] % 12, 4, axis=1))
    np.testing.assert_array_equal(four // 12, np.tile([3, 2, 1, 0], (len(four), 1)))
    assert (np.ptp(hits.depth.reshape(-1, 4), axis=1) == 0).all()
    distinct = trace(triangles[:12], colors[:12], OracleCamera(*view), 64, 64)
    np.testing.assert_array_equal(near_tie_pixels(hits), near_tie_pixels(distinct))


def test_cull_and_nothing_visible():
    sphere = scenes.nested_icospheres(1, 2)
    both, outer, inner = (trace(*sphere, front(), 40, 40, cull=cull) for cull in (None, "back", "front"))
    assert (outer.counts == inner.counts).all()
    assert (both.counts == 2 * outer.counts).all()
    assert (outer.depth < inner.depth).all()
    triangles, colors = scenes.offscreen_and_degenerate()
    hits = trace(triangles, colors, front(), 64, 64)
    assert set(hits.primitive) == {0}
    empty = trace(triangles[1:], colors[1:], front(), 64, 64)
    np.testing.assert_array_equal(composite(empty, (1, 0.5, 0, 0.5)), np.tile([0.5, 0.25, 0, 0.5], (64, 64, 1)))
    assert colour_bound(empty, 64, 64).shape == hull(empty)[0].shape == (64, 64, 4)


def test_no_painters_order_of_cyclic_three():
    hits = trace(*scenes.cyclic_three(), front(), 128, 128)
    first = {tuple(hits.primitive[pixel_hits(hits, p)][:2]) for p in np.flatnonzero(hits.counts.ravel() >= 2)}
    pairs = {pair for pair in first if pair[::-1] not in first}
    assert pairs in ({(0, 1), (1, 2), (2, 0)}, {(1, 0), (2, 1), (0, 2)})


def test_edge_distance_against_all_segments():
    triangles = scenes.random_triangles(30, 0.3, 2)[0]
    for size in ((40, 30), (30, 40)):
        y, x = np.mgrid[: size[1], : size[0]] + 0.5
        eye = triangles - (0, 0, 3)
        scale = size[1] / 2 / np.tan(np.pi / 8)
        at = np.stack(
            [size[0] / 2 + scale * eye[..., 0] / -eye[..., 2], size[1] / 2 - scale * eye[..., 1] / -eye[..., 2]], -1
        )
        best = np.ones(size[::-1])
        for p, q in np.concatenate([at[:, [0, 1]], at[:, [1, 2]], at[:, [2, 0]]]):
            t = np.clip(((x - p[0]) * (q - p)[0] + (y - p[1]) * (q - p)[1]) / ((q - p) @ (q - p)), 0, 1)
            best = np.minimum(best, np.hypot(x - p[0] - t * (q - p)[0], y - p[1] - t * (q - p)[1]))
        np.testing.assert_allclose(edge_distance(triangles, front(aspect=size[0] / size[1]), *size), best, atol=1e-9)


@pytest.mark.parametrize("near, far", [(None, None), (0.5, 3.2)])
def test_counts_change_only_across_edges(near, far):
    """Between neighbours with other primitives runs an edge (maybe near's or far's), at most 1/2 px from one of them."""
    triangles, colors = scenes.near_crossing()
    hits = trace(triangles, colors, front(near, far), 64, 64)
    seen = np.zeros((64 * 64, len(triangles)), bool)
    seen[hits.pixel, hits.primitive] = True
    seen = seen.reshape(64, 64, -1)
    distance = edge_distance(triangles, front(near, far), 64, 64)
    assert (seen[:, 1:] != seen[:, :-1]).any()
    for axis in (0, 1):
        a, b = (np.take(distance, np.arange(63) + k, axis) for k in (0, 1))
        changes = np.diff(seen, axis=axis).any(-1)
        assert (np.minimum(a, b)[changes] <= 0.5 + 1e-9).all()
    assert (distance == 1).any()


def float32_image(hits, background, order=None, error=0.0):
    """What a float32 renderer might give: the same lists with values off by `error` times the bound's shift."""
    color = (hits.color + hits.gradient * error * 4 * U * max(hits.width, hits.height)).astype(np.float32)
    image = np.zeros((hits.height * hits.width, 4), np.float32)
    for p in range(len(image)):
        c, t = np.zeros(4, np.float32), np.float32(1)
        for k in np.arange(hits.offsets[p], hits.offsets[p + 1])[order or slice(None)]:
            c += t * color[k, 3] * np.append(color[k, :3], np.float32(1))
            t *= 1 - color[k, 3]
        image[p] = c + t * np.float32(background[3]) * np.append(np.float32(background[:3]), np.float32(1))
    return image.reshape(hits.height, hits.width, 4)


@pytest.mark.parametrize("error", [0.0, 0.9, -0.9])
@pytest.mark.parametrize("seed, flat_faces", [(1, True), (2, False)])
def test_colour_bound_holds_and_bites(seed, flat_faces, error):
    background = (0.25, 0.5, 0.75, 0.5)
    hits = trace(*scenes.random_triangles(300, 0.4, seed, flat=flat_faces), front(), 24, 24)
    exact, bound = composite(hits, background), colour_bound(hits, 24, 24, background=background)
    assert hits.counts.max() > 10
    assert (np.abs(float32_image(hits, background, error=error) - exact) <= bound).all()
    assert (bound < 2e-4).all()  # 24 px * 4u * a gradient of 1 per px * a few layers: no bound that allows anything
    two = (hits.counts >= 2)[..., None]
    wrong = np.abs(float32_image(hits, background, slice(None, None, -1)) - exact)[..., :3] > bound[..., :3]
    assert (wrong | ~two).mean() > 0.9  # negative control: layers in the wrong order


def test_near_ties_and_hull():
    def stack(*depths):
        colors = np.random.default_rng(0).uniform(0.1, 0.9, (len(depths), 4))
        parts = [scenes.covering(3 - d, c) for d, c in zip(depths, colors, strict=True)]
        hits = trace(*(np.concatenate(p) for p in zip(*parts, strict=True)), front(), 4, 4)
        return hits, near_tie_pixels(hits).all(), *hull(hits, (1, 0, 0, 1))

    assert not stack(2, 2.001, 2.002)[1]
    assert not stack(2, 2, 2)[1]  # true ties
    hits, near, low, high = stack(2, 2.00001, 2.1, 2.10001)
    assert near
    images = []
    for order in ((0, 1, 2, 3), (1, 0, 2, 3), (0, 1, 3, 2), (1, 0, 3, 2)):
        c, t = np.zeros(4), 1.0
        for r, g, b, a in hits.color[list(order)]:
            c, t = c + t * a * np.array([r, g, b, 1]), t * (1 - a)
        images.append(c + t * np.array([1, 0, 0, 1]))
    np.testing.assert_allclose(low[0, 0], np.min(images, axis=0), atol=ROUNDING)
    np.testing.assert_allclose(high[0, 0], np.max(images, axis=0), atol=ROUNDING)
    image = composite(hits, (1, 0, 0, 1))
    assert ((low <= image) & (image <= high)).all()
    many, near, low, high = stack(*2 + 1e-6 * np.arange(6))
    assert near
    assert ((low < composite(many, (1, 0, 0, 1))) & (composite(many, (1, 0, 0, 1)) < high))[..., :3].all()


def test_scenes_are_float32_and_sized():
    built = [scenes.random_triangles(9), scenes.nested_icospheres(), scenes.cyclic_three(), scenes.bumpy_sphere(), scenes.near_crossing(),
             scenes.offscreen_and_degenerate(), scenes.covering(), scenes.layers(2000, 0.1), scenes.duplicates()]  # fmt: skip
    for triangles, colors in built:
        assert triangles.shape == (len(triangles), 3, 3)
        assert colors.shape == (len(triangles), 3, 4)
        assert np.array_equal(triangles.astype(np.float32), triangles)
        assert np.array_equal(colors.astype(np.float32), colors)
    assert len(built[3][0]) == 20480
    assert (trace(*scenes.covering(), front(aspect=2), 20, 10).counts == 1).all()
