"""The reference that every renderer here is measured against: rays through pixel centres, in float64.

A ray is cast through the centre of each pixel, *all* its hits are kept, sorted and composited. Nothing of the package
is imported: the point of this file is to be wrong in other ways than the package is.

Conventions: the centre of pixel [y, x] is (x + .5, y + .5), row 0 is on top. Depth is eye depth, -z in eye space, in
world units. A pixel's flat index is y * width + x. F counts hits, T triangles.
"""

from dataclasses import dataclass, field
from functools import cached_property
from itertools import permutations

import numpy as np

U = 2.0**-24  # unit roundoff of float32: the renderers' precision, not this file's
CHUNK = 1 << 18  # ray/triangle pairs at a time: temporaries stay in cache


@dataclass
class OracleCamera:
    """view, projection: (4, 4), M @ column; world to eye (OpenGL axes, looks along -Z) and eye to clip.

    near, far: eye depths, inclusive. near None cuts nothing in front of the eye (perspective: depth > 0, orthographic:
    depth >= 0). The z row of `projection` is never read.
    """

    view: np.ndarray
    projection: np.ndarray
    near: float | None = None
    far: float | None = None
    perspective: bool = field(init=False)

    def __post_init__(self):
        self.view = np.asarray(self.view, np.float64)
        self.projection = np.asarray(self.projection, np.float64)
        if not np.array_equal(self.view[3], (0, 0, 0, 1)):
            raise ValueError("view must be affine (is it transposed?)")
        if not any(np.array_equal(self.projection[3], row) for row in ((0, 0, -1, 0), (0, 0, 0, 1))):
            raise ValueError("projection's last row must be (0, 0, -1, 0) or (0, 0, 0, 1)")
        self.perspective = self.projection[3, 3] == 0

    def range(self):
        """(least, greatest) depth that is kept, both inclusive."""
        least = self.near if self.near is not None else (np.nextafter(0.0, 1.0) if self.perspective else 0.0)
        return least, np.inf if self.far is None else self.far


def _dot(a, b):
    # Written out: matmul and einsum may round differently from one array position to the next, and ties must be bitwise.
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]


def _cross(a, b):
    (ax, ay, az), (bx, by, bz) = np.moveaxis(a, -1, 0), np.moveaxis(b, -1, 0)
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], -1)


class _Setup:
    """Everything per triangle: canonical vertices, planes, screen boxes.

    Vertices are put in ascending order of (x, y, z). Then (1) faces with the same positions, whatever their rotation or
    winding, are computed by the very same operations and tie exactly; (2) an edge is always walked from its lesser to its
    greater end, so the two triangles that share it see exactly opposite values.
    """

    def __init__(self, triangles, colors, camera, width, height):
        triangles = np.asarray(triangles, np.float64).reshape(-1, 3, 3) + 0.0  # + 0.0: no negative zeros
        colors = np.asarray(colors, np.float64).reshape(-1, 3, 4)
        self.camera, self.width, self.height = camera, width, height
        order = np.lexsort(np.moveaxis(triangles[..., ::-1], -1, 0), axis=-1)
        self.even = (order[:, 1] - order[:, 0]) % 3 == 1  # the canonical order is a rotation of the given one
        self.world = np.take_along_axis(triangles, order[..., None], 1)
        self.color = np.take_along_axis(colors, order[..., None], 1)

        eye = np.stack([_dot(self.world, row[:3]) + row[3] for row in camera.view[:3]], -1)
        clip = np.stack([_dot(eye, row[:3]) + row[3] for row in camera.projection[:2]], -1)
        self.vertex_depth = -eye[..., 2]
        w = self.vertex_depth if camera.perspective else np.ones_like(self.vertex_depth)
        # Homogeneous pixel coordinates (x w, y w, w): no divide, so a vertex behind the eye does no harm.
        self.pixel = np.stack([(clip[..., 0] + w) * (width / 2), (w - clip[..., 1]) * (height / 2), w], -1)

        self.origin, e1, e2 = eye[:, 0], eye[:, 1] - eye[:, 0], eye[:, 2] - eye[:, 0]
        self.normal = _cross(e1, e2)
        with np.errstate(all="ignore"):  # degenerate triangles divide by zero here, and are never hit
            square = _dot(self.normal, self.normal)[:, None]
            self.b1 = _cross(e2, self.normal) / square  # barycentric 1 of a point P of the plane is b1 . (P - origin)
            self.b2 = _cross(self.normal, e1) / square

        a, b, c = np.moveaxis(self.pixel, 1, 0)
        area = np.sign(_dot(a, _cross(b - a, c - a)))  # + is clockwise to the viewer, since pixel y points down
        solid = _cross(self.world[:, 1] - self.world[:, 0], self.world[:, 2] - self.world[:, 0]).any(-1)
        self.side = np.where(solid, area, 0.0)
        self.front = np.where(self.even, -1, 1) * self.side > 0
        # Edges 01, 12, 02; the triangle lies left of 02 where it lies right of the others, hence the sign.
        self.edges = ((0, 1, self.side), (1, 2, self.side), (0, 2, -self.side))
        # A ray on an edge belongs to the side that a step to the right (then down) leads to: the top-left rule. The two
        # triangles of a shared edge lie on opposite sides, so exactly one owns it.
        self.owns = []
        for i, j, side in self.edges:
            p, q = self.pixel[:, i], self.pixel[:, j]
            right, down = side * (p[:, 1] * q[:, 2] - p[:, 2] * q[:, 1]), side * (p[:, 2] * q[:, 0] - p[:, 0] * q[:, 2])
            self.owns.append((right > 0) | ((right == 0) & (down > 0)))

        self.least_depth, self.most_depth = self.vertex_depth.min(1), self.vertex_depth.max(1)
        self.flat_depth = self.least_depth == self.most_depth
        self.least_color, self.most_color = self.color.min(1), self.color.max(1)
        self.flat_color = (self.least_color == self.most_color).all(-1)
        self.c1, self.c2 = self.color[:, 1] - self.color[:, 0], self.color[:, 2] - self.color[:, 0]
        self.ray_origin, self.ray = self._rays()
        # columns: the change of eye x, y per pixel in x and in y, at w = 1
        self.step = np.linalg.inv(camera.projection[:2, :2]) * (2 / width, -2 / height)

    @cached_property
    def tie(self):
        """(T,) equal where an equal depth is a true tie, in float32 too: faces with the same three positions, and flat
        layers (one depth at all three vertices) of the same depth. Elsewhere equality is an accident of rounding."""
        key = self.world.reshape(-1, 9).copy()
        key[self.flat_depth] = np.inf
        key[self.flat_depth, 0] = self.least_depth[self.flat_depth]
        return np.unique(key, axis=0, return_inverse=True)[1].reshape(-1)

    def boxes(self, cull):
        """Triangles that can be hit and their inclusive pixel boxes: ids, x0, y0, x1, y1."""
        least, most = self.camera.range()
        seen = (self.side != 0) & (self.most_depth >= least) & (self.least_depth <= most)
        if cull is not None:
            seen &= {"back": self.front, "front": ~self.front}[cull]
        ids = np.flatnonzero(seen)[
            ::-1
        ]  # later first, so that stable sorts leave the later of two equal depths in front
        p, size = self.pixel[ids], np.array([self.width, self.height])
        with np.errstate(all="ignore"):
            xy = p[..., :2] / p[..., 2:]
        # 1e-6 px is far over the rounding of the divide for any coordinate that lies in the image.
        low = np.clip(np.ceil(xy.min(1) - 0.5 - 1e-6), 0, size)
        high = np.clip(np.floor(xy.max(1) - 0.5 + 1e-6), -1, size - 1)
        behind = p[..., 2].min(1) <= 0  # crosses the eye's plane: the projection is unbounded
        low[behind], high[behind] = 0, size - 1
        keep = (low <= high).all(1)
        return (ids[keep], *low[keep].astype(np.int64).T, *high[keep].astype(np.int64).T)

    def inside(self, t, x, y):
        """Whether the rays through pixels x, y hit triangles t.

        With the ray moved to the origin an edge function is one 2-D cross product of its sheared ends. Rounding two products
        cannot swap them, so its sign is right or zero, and zero goes to the top-left rule. All three on the triangle's side
        means that the ray's point *in front of* the eye is a convex combination of the vertices.
        """
        x, y = x + 0.5, y + 0.5
        p = self.pixel[t]
        sx = [p[:, i, 0] - x * p[:, i, 2] for i in range(3)]
        sy = [p[:, i, 1] - y * p[:, i, 2] for i in range(3)]
        hit = np.ones(len(t), bool)
        for (i, j, side), owns in zip(self.edges, self.owns, strict=True):
            e = (sx[i] * sy[j] - sy[i] * sx[j]) * side[t]
            hit &= (e > 0) | ((e == 0) & owns[t])
        return hit

    def _rays(self):
        """Eye-space rays in steps of one unit of depth, origin + depth * ray: both (H*W, 3)."""
        x, y = np.meshgrid(
            2 * (np.arange(self.width) + 0.5) / self.width - 1, 1 - 2 * (np.arange(self.height) + 0.5) / self.height
        )
        ndc, zero = np.stack([x.ravel(), y.ravel()], -1), np.zeros((x.size, 1))
        slope, shear, constant = (self.camera.projection[:2, k] for k in (slice(0, 2), 2, 3))
        # Solved for eye x and y: slope @ (x, y) - shear * depth + constant = ndc * w, where w is the depth or 1.
        origin, ray = (
            (0 * ndc - constant, ndc + shear) if self.camera.perspective else (ndc - constant, 0 * ndc + shear)
        )
        inverse = np.linalg.inv(slope).T
        return np.concatenate([origin @ inverse, zero], 1), np.concatenate([ray @ inverse, zero - 1], 1)

    def depth(self, t, pixel):
        """Eye depths (n,) where rays meet the triangles' planes, kept within the vertices' range (edge-on triangles)."""
        n = self.normal[t]
        slope = _dot(n, self.ray[pixel])
        value = _dot(n, self.origin[t] - self.ray_origin[pixel]) / np.where(slope == 0, 1e-300, slope)
        return np.clip(value, self.least_depth[t], self.most_depth[t])

    def shade(self, t, pixel, depth):
        """Colours (n, 4): affine on the triangle's plane in space, which is perspective-correct on the screen."""
        color, vary = self.color[t, 0], ~self.flat_color[t]
        t, pixel, depth = t[vary], pixel[vary], depth[vary]
        p = self.ray_origin[pixel] + depth[:, None] * self.ray[pixel] - self.origin[t]
        value = color[vary] + _dot(self.b1[t], p)[:, None] * self.c1[t] + _dot(self.b2[t], p)[:, None] * self.c2[t]
        color[vary] = np.clip(value, self.least_color[t], self.most_color[t])
        return color

    def gradients(self, t, pixel, depth):
        """(n, 4), (n,): the greater of |d/dx| and |d/dy| of colour and of depth, per pixel."""
        color, deep = np.zeros((len(t), 4)), np.zeros(len(t))
        vary = np.flatnonzero(~(self.flat_color[t] & self.flat_depth[t]))
        t, ray, depth = t[vary], self.ray[pixel[vary]], depth[vary, None]
        n, by_color, by_depth = self.normal[t], 0.0, 0.0
        with np.errstate(all="ignore"):
            for axis in (0, 1):  # the hit moves by `move` in its plane, n . move = 0: that gives the change of depth
                side = (depth if self.camera.perspective else 1 + 0 * depth) * (*self.step[:, axis], 0.0)
                change = -_dot(n, side) / _dot(n, ray)
                move = side + change[:, None] * ray
                shade = _dot(self.b1[t], move)[:, None] * self.c1[t] + _dot(self.b2[t], move)[:, None] * self.c2[t]
                by_color = np.maximum(by_color, np.nan_to_num(np.abs(shade)))
                by_depth = np.maximum(by_depth, np.nan_to_num(np.abs(change)))
        color[vary], deep[vary] = by_color, by_depth
        return color, deep


@dataclass
class Hits:
    """All translucent hits, pixel by pixel (offsets: CSR, pixel p owns offsets[p]:offsets[p + 1]), front to back: depth
    ascending and, at exactly equal depth, the later primitive first.

    background (H, W, 4) is straight and valid where opaque_depth (H, W) is finite: there an opaque triangle was hit.
    opaque_gap (H, W): least relative distance to the opaque surface of another surface that does not truly tie with it.
    """

    width: int
    height: int
    offsets: np.ndarray  # (H*W + 1,) int64
    depth: np.ndarray  # (F,)
    primitive: np.ndarray  # (F,) int64
    color: np.ndarray  # (F, 4) straight
    background: np.ndarray
    opaque_depth: np.ndarray
    opaque_gap: np.ndarray
    setup: _Setup = field(repr=False)

    @property
    def counts(self):
        """(H, W) int64."""
        return np.diff(self.offsets).reshape(self.height, self.width)

    @cached_property
    def pixel(self):
        """(F,) flat pixel index."""
        return np.repeat(np.arange(self.width * self.height), np.diff(self.offsets))

    @cached_property
    def _gradients(self):
        parts = [
            self.setup.gradients(self.primitive[s], self.pixel[s], self.depth[s]) for s in _slices(len(self.depth))
        ]
        return np.concatenate([p[0] for p in parts]), np.concatenate([p[1] for p in parts])

    @property
    def gradient(self):
        """(F, 4) colour per pixel, the greater of x and y."""
        return self._gradients[0]

    @property
    def depth_gradient(self):
        """(F,) depth per pixel, the greater of x and y."""
        return self._gradients[1]

    def ranks(self, back_to_front=False):
        """Yields (pixels, hits): the first hit of every pixel that has one, then the second of those that have two, ..."""
        counts = np.diff(self.offsets)
        pixels, k = np.flatnonzero(counts), 0
        while pixels.size:
            yield pixels, self.offsets[pixels + 1] - 1 - k if back_to_front else self.offsets[pixels] + k
            k += 1
            pixels = pixels[counts[pixels] > k]


def _slices(n):
    return [slice(i, i + CHUNK) for i in range(0, max(n, 1), CHUNK)]


def _expand(first, last):
    """All integers first[i]..last[i] of every i: (owner, value)."""
    counts = np.maximum(last - first + 1, 0)
    owner = np.repeat(np.arange(len(counts)), counts)
    return owner, np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts - first, counts)


def trace(triangles, colors, camera, width, height, *, opaque=None, cull=None):
    """All hits of triangles (T, 3, 3) with straight colours (T, 3, 4) at the pixel centres -> Hits.

    opaque: (T,) bool; the nearest opaque hit (the later primitive at equal depth) hides what is strictly behind it and
    becomes its pixel's background with alpha 1. cull: None, "back" or "front"; counter-clockwise faces are front.
    """
    setup = _Setup(triangles, colors, camera, width, height)
    ids, x0, y0, x1, y1 = setup.boxes(cull)
    columns = x1 - x0 + 1
    total = np.cumsum(columns * (y1 - y0 + 1))
    least, most = camera.range()
    parts, begin = [], 0
    while begin < len(ids):
        done = total[begin - 1] if begin else 0
        end = max(begin + 1, int(np.searchsorted(total, done + CHUNK, side="right")))
        owner, local = _expand(np.zeros(end - begin, np.int64), np.diff(total[begin:end], prepend=done) - 1)
        owner += begin
        row, column = np.divmod(local, columns[owner])
        x, y, t = x0[owner] + column, y0[owner] + row, ids[owner]
        hit = setup.inside(t, x, y)
        t, pixel = t[hit], y[hit] * width + x[hit]
        depth = setup.depth(t, pixel)
        kept = (depth >= least) & (depth <= most)
        parts.append((pixel[kept], t[kept], depth[kept]))
        begin = end
    empty = (np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0))
    pixel, t, depth = (np.concatenate(arrays) for arrays in zip(empty, *parts, strict=True))
    order = np.lexsort((depth, pixel))  # stable, and the primitives descend already
    pixel, t, depth = pixel[order], t[order], depth[order]

    background, wall, gap = (
        np.zeros((width * height, 4)),
        np.full(width * height, np.inf),
        np.full(width * height, np.inf),
    )
    if opaque is not None and np.any(opaque):
        solid = np.asarray(opaque, bool)[t]
        at, first = np.unique(pixel[solid], return_index=True)
        front = np.full(width * height, -1)
        front[at] = t[solid][first]
        wall[at] = depth[solid][first]
        background[at, :3] = setup.shade(front[at], at, wall[at])[:, :3]
        background[at, 3] = 1.0
        other = np.isfinite(wall[pixel]) & (setup.tie[t] != setup.tie[front[pixel]])
        to, at = wall[pixel[other]], depth[other]
        scale = np.maximum(np.abs(at), np.abs(to)) if camera.perspective else np.abs(depth).max(initial=0)
        np.minimum.at(gap, pixel[other], np.abs(at - to) / np.maximum(scale, 1e-300))
        kept = ~solid & (depth <= wall[pixel])
        pixel, t, depth = pixel[kept], t[kept], depth[kept]

    offsets = np.concatenate([[0], np.cumsum(np.bincount(pixel, minlength=width * height))]).astype(np.int64)
    color = np.concatenate([setup.shade(t[s], pixel[s], depth[s]) for s in _slices(len(t))])
    shape = (height, width)
    return Hits(
        width,
        height,
        offsets,
        depth,
        t,
        color,
        background.reshape(*shape, 4),
        wall.reshape(shape),
        gap.reshape(shape),
        setup,
    )


def _behind(hits, background):
    """Straight background (H*W, 4), opaque surfaces included."""
    full = np.broadcast_to(np.asarray(background, np.float64), (hits.height, hits.width, 4))
    return np.where(np.isfinite(hits.opaque_depth)[..., None], hits.background, full).reshape(-1, 4)


def composite(hits, background=(0, 0, 0, 0)):
    """Front to back `over` in float64 -> premultiplied (H, W, 4). background: straight, (4,) or (H, W, 4)."""
    image = np.zeros((hits.height * hits.width, 4))
    through = np.ones(len(image))
    for pixels, i in hits.ranks():
        weight = through[pixels] * hits.color[i, 3]
        image[pixels, :3] += weight[:, None] * hits.color[i, :3]
        image[pixels, 3] += weight
        through[pixels] *= 1 - hits.color[i, 3]
    back = _behind(hits, background)
    image[:, :3] += (through * back[:, 3])[:, None] * back[:, :3]
    image[:, 3] += through * back[:, 3]
    return image.reshape(hits.height, hits.width, 4)


def edge_distance(triangles, camera, width, height):
    """(H, W): distance in pixels from each pixel's centre to the nearest projected edge of any triangle, at most 1.

    Edges count where they are in front of the eye and between near and far, and so do those that near and far cut.
    A rasteriser that snaps vertices may decide otherwise than a ray next to an edge, and nowhere else.
    """
    setup = _Setup(triangles, np.zeros((len(triangles), 3, 4)), camera, width, height)
    points = np.concatenate(
        [setup.pixel, setup.vertex_depth[..., None]], -1
    )  # x w, y w, w, depth: all affine on an edge
    a = np.concatenate([points[:, i] for i in (0, 1, 0)])
    b = np.concatenate([points[:, i] for i in (1, 2, 2)])
    least, most = camera.range()
    for plane in (least, most):
        if (
            np.finfo(np.float64).tiny <= abs(plane) < np.inf or plane == 0
        ):  # not "all in front of the eye", not "no far"
            cut = _cut(points, plane)
            a, b = np.concatenate([a, cut[:, 0]]), np.concatenate([b, cut[:, 1]])
    a, b = np.unique(np.concatenate([a, b], 1), axis=0).reshape(-1, 2, 4).swapaxes(0, 1)  # shared edges once

    def inside(p):  # six affine functions, not negative where p is kept
        x, y, w, depth = p.T
        return x + 2 * w, (width + 2) * w - x, y + 2 * w, (height + 2) * w - y, depth - least, most - depth

    # Clip before the divide to the depths kept and to 2 px around the image; beyond that no pixel is within 1 px.
    most = min(most, 1e300)
    begin, end = np.zeros(len(a)), np.ones(len(a))
    for fa, fb in zip(inside(a), inside(b), strict=True):
        with np.errstate(all="ignore"):
            at = fa / (fa - fb)
        begin = np.where((fa < 0) & (fb >= 0), np.maximum(begin, at), begin)
        end = np.where((fa >= 0) & (fb < 0), np.minimum(end, at), end)
        end = np.where((fa < 0) & (fb < 0), -1.0, end)
    keep = begin <= end
    a, b, begin, end = a[keep], b[keep], begin[keep, None], end[keep, None]
    p, q = np.where(begin > 0, a + begin * (b - a), a), np.where(end < 1, a + end * (b - a), b)
    keep = (p[:, 2] > 0) & (q[:, 2] > 0)  # w = 0 after the clip is the eye itself
    p, q = p[keep, :2] / p[keep, 2:3], q[keep, :2] / q[keep, 2:3]

    # Walk each segment along its longer axis u; along the other, v, the 3 nearest pixels hold all that are within 1 px,
    # because at a slope of at most 1 such a pixel is less than sqrt(2) < 1.5 px away in v.
    result = np.ones(width * height)
    steep = np.abs(q - p)[:, 1] > np.abs(q - p)[:, 0]
    for select, u, size in ((~steep, 0, (width, height)), (steep, 1, (height, width))):
        for s in _slices(int(select.sum())):
            m, n = p[select][s], q[select][s]
            low, high = np.minimum(m[:, u], n[:, u]), np.maximum(m[:, u], n[:, u])
            first, last = np.ceil(low - 1.5).astype(np.int64), np.floor(high + 0.5).astype(np.int64)
            owner, cell = _expand(np.maximum(first, 0), np.minimum(last, size[0] - 1))
            m, along = m[owner], (n - m)[owner]
            length = np.maximum(_dot2(along, along), 1e-300)
            with np.errstate(all="ignore"):
                ratio = np.clip(np.nan_to_num((cell + 0.5 - m[:, u]) / along[:, u]), 0, 1)
            row = np.floor(m[:, 1 - u] + ratio * along[:, 1 - u]).astype(np.int64)
            for v in (row - 1, row, row + 1):
                ok = (v >= 0) & (v < size[1])
                x, y = (cell, v) if u == 0 else (v, cell)
                offset = np.stack([x + 0.5, y + 0.5], -1) - m
                offset -= np.clip(_dot2(offset, along) / length, 0, 1)[:, None] * along
                np.minimum.at(result, (y * width + x)[ok], np.sqrt(_dot2(offset, offset))[ok])
    return result.reshape(height, width)


def _dot2(a, b):
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1]


def _cut(points, plane):
    """Segments (n, 2, 4) in which triangles with corners (T, 3, 4), depth last, meet the plane depth = `plane`."""
    above = points[..., 3] >= plane
    points, above = points[above.any(1) & ~above.all(1)], above[above.any(1) & ~above.all(1)]
    odd = np.where(above.sum(1) == 1, above.argmax(1), above.argmin(1))  # the corner that is alone on its side
    apex, ends = points[np.arange(len(odd)), odd], []
    for k in (1, 2):
        other = points[np.arange(len(odd)), (odd + k) % 3]
        at = (plane - apex[:, 3:]) / (other[:, 3:] - apex[:, 3:])
        ends.append(apex + at * (other - apex))
        ends[-1][:, 3] = plane  # exactly on it, so that the clip keeps it
    return np.stack(ends, 1)


def colour_bound(hits, width, height, *, background=(0, 0, 0, 0), interpolation_ulps=0.0):
    """(H, W, 4): how far a float32 renderer with the right hits in the right order may be off `composite`, per channel.

    - 2 (n + 1) u C: n layers and a background, each with at most two roundings in T, one in the product and one in the sum;
      with non-negative colours nothing cancels, so the error is relative to the result C (RGB premultiplied, or alpha).
    - Interpolation: float32 vertices are off by up to 4 u max(W, H) pixels, so that a layer's colour c and alpha a are off
      by that times their gradients. C is affine in each: dC/dc = T a and dC/da = T (c - behind), where `behind` is the
      composite of all that lies behind the layer; the latter is both the layer's own share and what it hides. Alpha is
      the same sum with c = 1: dA/da = T (1 - A_behind). Products of two such errors (u squared) are left out.
    - interpolation_ulps: roundings of the interpolated value itself, in units of u, relative to it, where it is not flat
      (a flat one is exact when clamped to its vertices). 0 leaves the two terms above alone.
    """
    shift = 4 * U * max(width, height)
    ulps = interpolation_ulps * U
    back = _behind(hits, background)
    behind = np.concatenate([back[:, :3] * back[:, 3:], back[:, 3:]], 1)
    error = np.zeros_like(behind)
    for pixels, i in hits.ranks(back_to_front=True):
        alpha, color, gradient = hits.color[i, 3:], hits.color[i], hits.gradient[i]  # copies
        d_alpha = gradient[:, 3:] * shift + (gradient[:, 3:] > 0) * ulps * alpha
        color[:, 3], gradient[:, 3] = 1.0, 0.0
        d_color = gradient * shift + (gradient > 0) * ulps * color
        own = alpha * d_color + np.abs(color - behind[pixels]) * d_alpha
        error[pixels] = own + (1 - alpha) * error[pixels]
        behind[pixels] = alpha * color + (1 - alpha) * behind[pixels]
    n = np.diff(hits.offsets)[:, None]
    return (2 * (n + 1) * U * behind + error).reshape(height, width, 4)


def _groups(hits, relative):
    """Hits whose order float32 cannot tell: (start (F,), mixed (F,)) bool. `start` begins a group of consecutive hits with
    overlapping depth intervals; `mixed` marks a hit that does not truly tie with the first one of its group.

    An interval is half of `relative` around the depth (an orthographic depth: of the greatest depth, for its error is not
    relative to itself), plus what a shift of the float32 vertices does to a steep triangle's depth.
    """
    depth, tie = hits.depth, hits.setup.tie[hits.primitive]
    scale = np.abs(depth) if hits.setup.camera.perspective else np.abs(depth).max(initial=0)
    reach = 0.5 * relative * scale + 4 * U * max(hits.width, hits.height) * hits.depth_gradient
    reach = np.minimum(reach, 1e300)  # finite, so that a pixel's first hit always starts a group
    start, mixed = np.zeros(len(depth), bool), np.zeros(len(depth), bool)
    upper, first = np.full(hits.width * hits.height, -np.inf), np.zeros(hits.width * hits.height, np.int64)
    for pixels, i in hits.ranks():
        start[i] = new = depth[i] - reach[i] > upper[pixels]
        upper[pixels] = np.maximum(upper[pixels], depth[i] + reach[i])
        first[pixels] = np.where(new, tie[i], first[pixels])
        mixed[i] = tie[i] != first[pixels]
    return start, mixed


def near_tie_pixels(hits, relative=1e-5):
    """(H, W) bool: pixels with two hits (or a hit and the opaque surface) so close that float32 cannot tell their order.

    True ties, which the primitive decides, are not near ties: faces with the same three positions, flat layers of one depth.
    """
    _, mixed = _groups(hits, relative)
    found = np.bincount(hits.pixel[mixed], minlength=hits.width * hits.height) > 0
    return found.reshape(hits.height, hits.width) | (hits.opaque_gap < relative)


def hull(hits, background=(0, 0, 0, 0), relative=1e-5):
    """(low, high), (H, W, 4) each: the premultiplied results that near ties allow; equal where there are none.

    What a group lets through does not depend on its order, so groups vary independently and their extremes add up. Up to 4
    hits are permuted. More: their weights sum to the group's alpha in any order, so alpha times the extreme colours
    holds them all. Near ties with the opaque surface decide whether a layer is there at all: (-inf, inf).
    """
    image = composite(hits, background).reshape(-1, 4)
    low, high = image.copy(), image.copy()
    start, mixed = _groups(hits, relative)
    first = np.flatnonzero(start)
    if mixed.any():
        size = np.diff(first, append=len(start))
        rows = np.flatnonzero(np.add.reduceat(mixed, first))  # the groups that are undecided
        through = np.ones(len(start))  # in front of each hit
        running = np.ones(len(image))
        for pixels, i in hits.ranks():
            through[i] = running[pixels]
            running[pixels] *= 1 - hits.color[i, 3]
        for n in np.unique(size[rows]):
            begin = first[rows][size[rows] == n]
            color = hits.color[begin[:, None] + np.arange(n)]  # (groups, n, 4)
            given = _over(color)
            if n <= 4:
                results = np.stack([_over(color[:, order]) for order in permutations(range(n))])
            else:
                alpha = 1 - np.prod(1 - color[..., 3:], axis=1)
                results = np.stack([alpha * color[..., :3].min(1), alpha * color[..., :3].max(1)])
            weight, pixel = through[begin][:, None], hits.pixel[begin]
            np.add.at(low[:, :3], pixel, weight * np.minimum(results.min(0) - given, 0))
            np.add.at(high[:, :3], pixel, weight * np.maximum(results.max(0) - given, 0))
    unknown = hits.opaque_gap.reshape(-1) < relative
    low[unknown], high[unknown] = -np.inf, np.inf
    return low.reshape(hits.height, hits.width, 4), high.reshape(hits.height, hits.width, 4)


def _over(color):
    """Premultiplied RGB (groups, 3) of straight layers (groups, n, 4), front first."""
    alpha = color[..., 3:]
    front = np.cumprod(np.concatenate([np.ones_like(alpha[:, :1]), 1 - alpha[:, :-1]], 1), axis=1)
    return (front * alpha * color[..., :3]).sum(1)
