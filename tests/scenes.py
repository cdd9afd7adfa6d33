"""Deterministic test scenes: each function returns (triangles (T, 3, 3), colors (T, 3, 4)), float64, world units.

All values are exactly representable in float32 (far_from_origin excepted), so that a float32 renderer and a float64 one
are given the same scene. Colours are straight RGBA per corner. Unless a docstring says otherwise a scene lies around
the origin and is meant for `front_camera`, whose eye is at (0, 0, 3). Where it can, geometry is shifted by an odd amount,
so that no vertex or edge passes exactly through a pixel centre.
"""

import numpy as np

EYE = (0.0, 0.0, 3.0)
SHIFT = np.array([np.sqrt(2), np.sqrt(3), np.sqrt(5)]) / 997  # about a pixel's thousandths: on no grid of pixel centres
FAR_AWAY = 2.0**60  # an orthographic camera without far plane keeps what is nearer than this


def _f32(values):
    """The nearest float32 values, as float64."""
    return np.asarray(values, np.float64).astype(np.float32).astype(np.float64)


def _flat(colors, faces_each=1):
    """One RGBA per face, (T, 4) -> (T * faces_each, 3, 4)."""
    colors = np.repeat(_f32(colors).reshape(-1, 1, 4), faces_each, axis=0)
    return np.repeat(colors, 3, axis=1)


def _view(eye, target, up):
    eye, target, up = (np.asarray(v, np.float64) for v in (eye, target, up))
    back = (eye - target) / np.linalg.norm(eye - target)
    right = np.cross(up, back)
    right /= np.linalg.norm(right)
    view = np.eye(4)
    view[:3, :3] = right, np.cross(back, right), back
    view[:3, 3] = -view[:3, :3] @ eye
    return view


def look_at(eye, target, up=(0, 1, 0), fov_y_deg=45.0, aspect=1.0, near=None, far=None):
    """(view, projection), both (4, 4), M @ column; aspect = width / height; clip z in 0..1, near at 0.

    near None and far None: clip z is w / 2, so that nothing in front of the eye is cut.
    """
    scale = 1 / np.tan(np.radians(fov_y_deg) / 2)
    projection = np.diag([scale / aspect, scale, 0.0, 0.0])
    projection[3, 2] = -1
    if near is None and far is None:
        projection[2, 2] = -0.5
    elif far is None:
        projection[2, 2:] = -1, -near
    else:
        near = far / FAR_AWAY if near is None else near  # depths below it do not occur in these scenes
        projection[2, 2:] = far / (near - far), far * near / (near - far)
    return _view(eye, target, up), projection


def orthographic(eye, target, up=(0, 1, 0), height=2.0, aspect=1.0, near=None, far=None):
    """(view, projection) as look_at's; height: full height of the image in world units. near None: depth >= 0."""
    near = 0.0 if near is None else near
    far = FAR_AWAY if far is None else far
    projection = np.diag([2 / (height * aspect), 2 / height, -1 / (far - near), 1.0])
    projection[2, 3] = -near / (far - near)
    return _view(eye, target, up), projection


def front_camera(aspect=1.0, near=None, far=None, fov_y_deg=45.0):
    """(view, projection) from (0, 0, 3) to the origin: the camera of all scenes here. Depth is exactly 3 - z."""
    return look_at(EYE, (0, 0, 0), (0, 1, 0), fov_y_deg, aspect, near, far)


def random_triangles(n, size=0.3, seed=0, *, flat=False):
    """n triangles in the unit cube around the origin: corners uniform within `size` of a uniform centre.

    RGB uniform in 0..1 and alpha in 0.1..0.9, per corner, or per face if `flat`.
    """
    rng = np.random.default_rng(seed)
    triangles = rng.uniform(-0.5, 0.5, (n, 1, 3)) + rng.uniform(-size, size, (n, 3, 3))
    colors = rng.uniform(0, 1, (n, 3, 4))
    colors[..., 3] = 0.1 + 0.8 * colors[..., 3]
    return _f32(triangles), _flat(colors[:, 0]) if flat else _f32(colors)


def icosphere(subdivisions):
    """vertices (V, 3) on the unit sphere and faces (20 * 4**subdivisions, 3), counter-clockwise seen from outside."""
    g = (1 + np.sqrt(5)) / 2
    vertices = np.array([(-1, g, 0), (1, g, 0), (-1, -g, 0), (1, -g, 0), (0, -1, g), (0, 1, g),
                         (0, -1, -g), (0, 1, -g), (g, 0, -1), (g, 0, 1), (-g, 0, -1), (-g, 0, 1)])  # fmt: skip
    faces = np.array([(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4), (11, 10, 2),
                      (10, 7, 6), (7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9), (4, 9, 5),
                      (2, 4, 11), (6, 2, 10), (8, 6, 7), (9, 8, 1)])  # fmt: skip
    for _ in range(subdivisions):
        ends = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
        edges, which = np.unique(ends, axis=0, return_inverse=True)
        ab, bc, ca = which.reshape(3, -1) + len(vertices)
        vertices = np.concatenate([vertices, vertices[edges].mean(1)])
        a, b, c = faces.T
        faces = np.concatenate(
            [np.stack(corner, 1) for corner in ((a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca))]
        )
    return vertices / np.linalg.norm(vertices, axis=1, keepdims=True), faces


def nested_icospheres(levels=4, subdivisions=3):
    """Closed spheres within each other, radius 0.9 and inwards, each of one colour: every pixel has an even count."""
    vertices, faces = icosphere(subdivisions)
    radii = 0.9 * (1 - np.arange(levels) / (levels + 1))
    triangles = np.concatenate([_f32(vertices * r + SHIFT)[faces] for r in radii])
    rng = np.random.default_rng(levels)
    return triangles, _flat(np.c_[rng.uniform(0.1, 1, (levels, 3)), np.linspace(0.25, 0.6, levels)], len(faces))


def cyclic_three():
    """Three long triangles, each over the next and the last over the first: no order of whole triangles is right."""
    one = np.array([(-0.9, -0.12, 0.3), (0.9, -0.12, -0.3), (0.9, 0.12, -0.3)]) + (0.0, -0.35, 0.0)
    turns = [2 * np.pi * k / 3 for k in range(3)]
    spin = np.array([[(np.cos(t), -np.sin(t), 0), (np.sin(t), np.cos(t), 0), (0, 0, 1)] for t in turns])
    triangles = np.einsum("kij,vj->kvi", spin, one) + SHIFT
    return _f32(triangles), _flat([(0.9, 0.2, 0.1, 0.5), (0.1, 0.8, 0.2, 0.6), (0.1, 0.3, 0.9, 0.7)])


def bumpy_sphere(subdivisions=5):
    """A closed sphere with dents, many layers at its rim: 20,480 faces, colours per vertex, alpha 0.2 to 0.6."""
    vertices, faces = icosphere(subdivisions)
    x, y, z = vertices.T
    bumps = 0.08 * np.sin(11 * x + 0.3) * np.sin(13 * y + 0.7) * np.sin(9 * z + 1.1)
    positions = _f32(vertices * (0.9 + bumps)[:, None] + SHIFT)
    colors = _f32(np.c_[0.5 + 0.45 * vertices, 0.4 + 0.2 * np.sin(7 * x) * np.cos(5 * y)])
    return positions[faces], colors[faces]


def near_crossing():
    """Triangles from in front of the eye (0, 0, 3) to beside and behind it, and one wholly behind; colours vary.

    With near = 0.5 all but the last are cut by the near plane, one of them with two corners behind it.
    """
    triangles = [
        [(-1.0, -0.4, 0.0), (1.1, -0.5, 0.2), (0.1, -0.3, 5.0)],  # floor: one corner behind the eye
        [(-0.2, 0.8, -1.0), (0.9, 0.35, 4.5), (-1.3, 0.45, 6.0)],  # ceiling: two corners behind
        [(-0.5, -2.0, 1.0), (-0.6, 2.0, 1.0), (-0.3, 0.1, 7.0)],  # wall to the left
        [(-0.8, -0.7, 2.4), (0.9, -0.6, 2.7), (0.0, 0.9, 2.2)],  # in front of the eye, across near = 0.5
        [(-1.0, -1.0, 3.5), (1.0, -1.0, 3.5), (0.0, 1.0, 4.0)],  # behind: never seen
    ]
    rng = np.random.default_rng(5)
    return _f32(np.array(triangles) + SHIFT), _f32(rng.uniform(0.2, 0.8, (len(triangles), 3, 4)))


def offscreen_and_degenerate():
    """One visible triangle (the first) among some that must give nothing: outside on each side, points, lines, edge-on."""
    triangles = [
        [(-0.7, -0.6, 0.0), (0.8, -0.5, 0.1), (0.1, 0.7, -0.1)],
        *(
            [(9 * x, 9 * y, 0.0), (9 * x + 1, 9 * y, 0.0), (9 * x, 9 * y + 1, 0.0)]
            for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1))
        ),
        [(0.25, 0.25, 0.0)] * 3,
        [(-0.5, 0.25, 0.0), (0.5, 0.25, 0.0), (0.5, 0.25, 0.0)],
        [(-0.5, -0.5, 0.5), (0.0, 0.0, 0.5), (0.5, 0.5, 0.5)],  # collinear, through the image's middle
        [(-1.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)],  # in the plane y = 0 of the eye: edge-on
    ]
    rng = np.random.default_rng(7)
    colors = rng.uniform(0.2, 0.8, (len(triangles), 4))
    return _f32(triangles), _flat(colors)


def covering(z=0.0, color=(0.3, 0.6, 0.9, 0.5)):
    """One flat triangle at depth 3 - z that covers the whole image (at any field of view below 90 degrees, aspect below 3)."""
    size = 6 * (EYE[2] - z)
    triangle = np.array([(-size, -size, z), (3 * size, -size, z), (-size, 3 * size, z)])
    return _f32(triangle[None]), _flat([color])


def layers(n, alpha=0.5, *, seed=0):
    """n flat triangles that cover the whole image, in shuffled submission order, random colours, one alpha.

    Depths are 1.5 * 1.0002**k: each step is 2e-4 of the depth, well over what float32 can tell apart (n <= 20,000).
    """
    if n > 20_000:
        raise ValueError("beyond 20,000 layers the triangles grow out of float32's comfortable range")
    rng = np.random.default_rng(seed)
    z = rng.permutation(EYE[2] - 1.5 * 1.0002 ** np.arange(n))
    triangles = np.concatenate([covering(value)[0] for value in z]) if n else np.zeros((0, 3, 3))
    return triangles, _flat(np.c_[rng.uniform(0, 1, (n, 3)), np.full(n, alpha)])


def duplicates(n=12, seed=3):
    """Random faces, then the same faces rotated, reversed, and as they were, each time in other colours: all four tie."""
    first, _ = random_triangles(n, 0.5, seed)
    triangles = np.concatenate([first, np.roll(first, 1, axis=1), first[:, ::-1], first])
    colors = random_triangles(4 * n, 0.5, seed + 1)[1]
    return triangles, colors


def far_from_origin(offset=1e6, n=200, seed=4):
    """random_triangles moved by (offset, offset, offset): float64 positions that float32 cannot hold.

    Look at it from (offset, offset, offset + 3). Positions are multiples of 2**-24, so that the move is exact and
    triangles - offset is the scene as it was around the origin.
    """
    triangles, colors = random_triangles(n, 0.3, seed)
    return np.round(triangles * 2**24) / 2**24 + offset, colors
