"""Per-pixel fragment lists."""

import json
from typing import NamedTuple

import numpy as np

from . import _check, _core
from .errors import ParameterError, SceneError


class Padded(NamedTuple):
    """Lists as arrays of one length a pixel, front first."""

    depth: np.ndarray  # (H, W, k), inf where there is no fragment
    color: np.ndarray  # (H, W, k, 4) straight, 0 there
    primitive: np.ndarray  # (H, W, k) int32, −1 there
    coverage: None
    dropped: int  # fragments of pixels with more than k


class Fragments:
    """All fragments of an image, pixel by pixel, sorted front to back; equal keys: later primitive first.

    Pixel p = y·W + x owns entries ``offsets[p]:offsets[p + 1]`` of the arrays below. ``frags[y, x]`` is one
    pixel's list as a record array, ``frags[y0:y1, x0:x1]`` the lists of a part of the image.

    Args:
        shape: (H, W).
        offsets: (H·W + 1,) int64.
        depth: (F,) float32 or float64, eye depth in world units.
        color: (F, 4) straight RGBA.
        key: (F,) unsigned, what was sorted by, smaller in front. None: made from the depth.
        primitive: (F,) int32. None: counted from 0 in each pixel.
        background: straight RGBA behind the lists, (4,) or (H, W, 4).

    Raises:
        SceneError: arrays that do not fit together, or a list that is not sorted.

    >>> frags = Fragments((1, 1), [0, 2], [1., 2.], [[1, 0, 0, .5], [0, 1, 0, .5]])
    >>> frags.composite()[0, 0].tolist()
    [0.5, 0.25, 0.0, 0.75]
    >>> frags[0, 0].depth.tolist()
    [1.0, 2.0]
    """

    coverage = None
    blend = None
    samples = 1

    def __init__(self, shape, offsets, depth, color, key=None, primitive=None, background=(0, 0, 0, 0)):
        height, width = (int(n) for n in shape)
        self.shape = (height, width)
        self.offsets = np.ascontiguousarray(offsets, dtype=np.int64)
        self.depth = _floats(depth)
        self.color = _check.straight_rgba("color", np.reshape(color, (-1, 4)) if np.size(color) == 0 else color)
        n = len(self.depth)
        counts = np.diff(self.offsets)
        if self.offsets.shape != (height * width + 1,) or self.offsets[0] != 0 or (counts < 0).any():
            raise SceneError(f"offsets must be ({height * width + 1},) for shape {self.shape} and rise from 0")
        if not (self.offsets[-1] == n == len(self.color)) or self.depth.ndim != 1 or self.color.ndim != 2:
            raise SceneError(
                f"offsets end at {self.offsets[-1]}, but depth is {self.depth.shape} and color {self.color.shape}"
            )
        self.key = _orderable(self.depth) if key is None else np.ascontiguousarray(key)
        if primitive is None:
            primitive = np.arange(n) - np.repeat(self.offsets[:-1], counts)
        self.primitive = np.ascontiguousarray(primitive, dtype=np.int32)
        if self.key.shape != (n,) or self.key.dtype.kind != "u" or self.primitive.shape != (n,):
            raise SceneError(f"key and primitive must be ({n},), key unsigned, got {self.key.shape}, {self.key.dtype}")
        if n:
            same = self.pixel[1:] == self.pixel[:-1]
            unsorted = same & (self.key[1:] < self.key[:-1])
            if unsorted.any():
                y, x = divmod(int(self.pixel[1:][unsorted][0]), width)
                raise SceneError(f"the list of pixel [{y}, {x}] is not sorted front to back")
        self.background = np.broadcast_to(_check.straight_rgba("background", background), (height, width, 4))
        self._window = (0, 0, height, width)

    @classmethod
    def _of(cls, shape, parts, background):
        """From the core's arrays, which are known to be sound."""
        self = cls.__new__(cls)
        self.shape = shape
        for field in ("offsets", "depth", "key", "color", "primitive"):
            setattr(self, field, parts[field])
        self.background = np.broadcast_to(background, (*shape, 4))
        self._window = (0, 0, *shape)
        return self

    @classmethod
    def from_padded(cls, depth, color, background=(0, 0, 0, 0)):
        """From (H, W, K) depths, not finite where there is no fragment, and (H, W, K, 4) straight colours.

        Lists need not be sorted; of equal depths the later of the K is in front.
        """
        depth = _floats(depth)
        color = _check.straight_rgba("color", np.where(np.isfinite(depth)[..., None], color, 0))
        if depth.ndim != 3 or color.shape != (*depth.shape, 4):
            raise SceneError(f"depth must be (H, W, K) and color (H, W, K, 4), got {depth.shape} and {color.shape}")
        height, width, k = depth.shape
        flat = depth.reshape(-1, k)
        # A stable sort of the reversed list puts the later of two equal depths in front.
        order = k - 1 - np.argsort(np.where(np.isfinite(flat), flat, np.inf)[:, ::-1], axis=1, kind="stable")
        sorted_depth = np.take_along_axis(flat, order, axis=1)
        kept = np.isfinite(sorted_depth)
        sorted_color = np.take_along_axis(color.reshape(-1, k, 4), order[..., None], axis=1)
        offsets = np.concatenate([[0], np.cumsum(kept.sum(axis=1))])
        return cls(
            (height, width),
            offsets,
            sorted_depth[kept],
            sorted_color[kept],
            primitive=order[kept],
            background=background,
        )

    @property
    def counts(self) -> np.ndarray:
        """Fragments a pixel, (H, W) int32."""
        return np.diff(self.offsets).astype(np.int32).reshape(self.shape)

    @property
    def pixel(self) -> np.ndarray:
        """The pixel of each fragment, y·W + x, (F,) int64."""
        return np.repeat(np.arange(len(self.offsets) - 1), np.diff(self.offsets))

    def __len__(self):
        return len(self.depth)

    def __repr__(self):
        height, width = self.shape
        return f"Fragments({height}×{width} pixels, {len(self)} fragments)"

    def __getitem__(self, index):
        if not (isinstance(index, tuple) and len(index) == 2):
            raise ParameterError("index with [y, x] or [y0:y1, x0:x1]")
        if any(isinstance(i, slice) for i in index):
            return self._cropped(index)
        y, x = (_wrapped(i, n) for i, n in zip(index, self.shape, strict=True))
        pixel = y * self.shape[1] + x
        part = slice(self.offsets[pixel], self.offsets[pixel + 1])
        dtype = [
            ("depth", self.depth.dtype),
            ("color", self.color.dtype, 4),
            ("primitive", np.int32),
            ("key", self.key.dtype),
        ]
        records = np.recarray(part.stop - part.start, dtype=dtype)
        for field, *_ in dtype:
            records[field] = getattr(self, field)[part]
        return records

    def _cropped(self, index):
        ranges = []
        for i, n in zip(index, self.shape, strict=True):
            if not isinstance(i, slice):
                first = _wrapped(i, n)
                i = slice(first, first + 1)
            start, stop, step = i.indices(n)
            if step != 1:
                raise ParameterError(f"slices of Fragments must have step 1, got {step}")
            ranges.append((start, max(start, stop)))
        (y0, y1), (x0, x1) = ranges
        counts = np.diff(self.offsets).reshape(self.shape)[y0:y1, x0:x1].ravel()
        first = self.offsets[:-1].reshape(self.shape)[y0:y1, x0:x1].ravel()
        offsets = np.concatenate([[0], np.cumsum(counts)])
        taken = np.arange(offsets[-1]) + np.repeat(first - offsets[:-1], counts)
        parts = {f: getattr(self, f)[taken] for f in ("depth", "key", "color", "primitive")}
        crop = Fragments._of((y1 - y0, x1 - x0), parts | {"offsets": offsets}, self.background[y0:y1, x0:x1])
        oy, ox, height, width = self._window
        crop._window = (oy + y0, ox + x0, height, width)
        return crop

    def composite(self, method="exact", background=None, **options) -> np.ndarray:
        """The image of these lists, (H, W, 4) float64, premultiplied.

        Args:
            method: one of `abuffer.methods()`.
            background: straight, grey, (3|4,) or (H, W, 3|4). None: the lists' own.
        """
        _check.choice("method", method, METHODS)
        _check.options(options, (), f"method {method!r}")
        background = self.background if background is None else as_background(background, self.shape)
        image = np.ascontiguousarray(np.broadcast_to(background, (*self.shape, 4)), dtype=np.float64)
        return _core.composite(self.offsets, self.color, image).reshape(*self.shape, 4)

    def to_padded(self, k=None) -> Padded:
        """The k nearest fragments of each pixel as dense arrays. None: as many as the deepest pixel has."""
        counts = np.diff(self.offsets)
        deepest = int(counts.max(initial=0))
        k = deepest if k is None else int(_check.number("k", k, 0))
        layer = np.arange(len(self)) - np.repeat(self.offsets[:-1], counts)
        kept = layer < k
        at = self.pixel[kept], layer[kept]
        shape = (len(counts), k)
        depth = np.full(shape, np.inf, self.depth.dtype)
        color = np.zeros((*shape, 4), self.color.dtype)
        primitive = np.full(shape, -1, np.int32)
        depth[at], color[at], primitive[at] = self.depth[kept], self.color[kept], self.primitive[kept]
        height, width = self.shape
        return Padded(
            depth.reshape(height, width, k),
            color.reshape(height, width, k, 4),
            primitive.reshape(height, width, k),
            None,
            int((~kept).sum()),
        )

    def points(self, camera) -> np.ndarray:
        """World positions of the fragments, (F, 3) float64: on the ray through the pixel's centre."""
        view, projection, ndc = self._rays(camera)
        # Solve the x and y rows of the projection for the eye position at the known depth.
        z = -self.depth.astype(np.float64)
        w = projection[3, 2] * z + projection[3, 3]
        known = ndc * w[:, None] - np.outer(z, projection[:2, 2]) - projection[:2, 3]
        eye = np.column_stack([known @ np.linalg.inv(projection[:2, :2]).T, z])
        return (eye - view[:3, 3]) @ np.linalg.inv(view[:3, :3]).T

    def barycentric(self, scene, camera) -> np.ndarray:
        """Perspective-correct barycentric coordinates in each fragment's triangle, (F, 3) float64.

        At an edge they may leave [0, 1] by what snapping to 1/256 pixel moves it.
        """
        from .scene import as_scene

        view, projection, ndc = self._rays(camera)
        result = np.empty((len(self), 3))
        triangles = as_scene(scene).triangles()
        if len(self) and self.primitive.max() >= len(triangles):
            raise ParameterError(f"the lists name primitive {self.primitive.max()}, the scene has {len(triangles)}")
        to_clip = (projection @ view)[[0, 1, 3]]
        for start in range(0, len(self), 1 << 18):  # bounds the corners that are held at once
            part = slice(start, start + (1 << 18))
            clip = triangles[self.primitive[part]] @ to_clip[:, :3].T + to_clip[:, 3]
            # Relative to the pixel's ray, b is the null vector of the corners' (x, y): two cross products.
            x, y = (clip[..., i] - ndc[part, None, i] * clip[..., 2] for i in (0, 1))
            b = np.stack([x[:, i] * y[:, j] - x[:, j] * y[:, i] for i, j in ((1, 2), (2, 0), (0, 1))], axis=1)
            result[part] = b / b.sum(axis=1, keepdims=True)
        return result

    def _rays(self, camera):
        """The camera's matrices for the whole image, and each fragment's pixel centre in NDC, (F, 2)."""
        y0, x0, height, width = self._window
        view, projection = camera.matrices(width, height)
        y, x = np.divmod(self.pixel, self.shape[1])
        centers = np.column_stack([x + x0 + 0.5, y + y0 + 0.5])
        return view, projection, (centers / (width, height) - 0.5) * (2, -2)

    def to_pandas(self):
        """A table, one row a fragment: y, x, layer (0 in front), depth, r, g, b, a, primitive."""
        try:
            import pandas as pd
        except ImportError as e:
            from .errors import UnsupportedError

            raise UnsupportedError("to_pandas needs pandas: pip install 'abuffer[compare]'") from e
        y, x = np.divmod(self.pixel, self.shape[1])
        layer = np.arange(len(self)) - np.repeat(self.offsets[:-1], np.diff(self.offsets))
        columns = {"y": y, "x": x, "layer": layer, "depth": self.depth}
        columns |= dict(zip("rgba", self.color.T, strict=True)) | {"primitive": self.primitive}
        return pd.DataFrame(columns)

    def save(self, path):
        """Writes an .npz that `load` reads."""
        np.savez_compressed(path, **self._arrays())

    @classmethod
    def load(cls, path):
        """Reads what `save` wrote."""
        with np.load(path, allow_pickle=False) as arrays:
            return cls._from_arrays(arrays)

    def _arrays(self):
        uniform = (self.background == self.background[:1, :1]).all() if self.background.size else False
        return {
            "shape": np.array(self.shape),
            "offsets": self.offsets,
            "depth": self.depth,
            "key": self.key,
            "color": self.color,
            "primitive": self.primitive,
            "window": np.array(self._window),
            "background": self.background[0, 0] if uniform else self.background,
            "format": np.array(json.dumps({"abuffer": "fragments", "version": 1})),
        }

    @classmethod
    def _from_arrays(cls, arrays):
        missing = {"shape", "offsets", "depth", "key", "color", "primitive"} - set(arrays)
        if missing:
            raise SceneError(f"the file holds no fragment lists: {', '.join(sorted(missing))} missing")
        fields = {f: arrays[f] for f in ("offsets", "depth", "color", "key", "primitive", "background")}
        self = cls(tuple(arrays["shape"]), **fields)
        self._window = tuple(int(v) for v in arrays["window"])
        return self


METHODS = tuple(row[0] for row in _core.methods())


def as_background(value, shape):
    """A background as straight RGBA, (4,) or (H, W, 4): grey, (3|4,) or (H, W, 3|4) given."""
    array = np.asarray(value)
    if array.ndim == 0:
        array = np.repeat(array, 3)
    array = _check.straight_rgba("background", array, ParameterError)
    if array.ndim != 1 and array.shape != (*shape, 4):
        raise ParameterError(
            f"background must be grey, (3|4,) or (H, W, 3|4) with H, W = {shape}, got shape {np.shape(value)}"
        )
    return array


def _floats(values):
    array = np.ascontiguousarray(values)
    return array if array.dtype in (np.float32, np.float64) else array.astype(np.float64)


def _orderable(depth):
    """Unsigned integers in the order of the depths; −0 counts as +0."""
    kind = np.uint32 if depth.dtype == np.float32 else np.uint64
    bits = (depth + 0).view(kind)
    sign = kind(1) << kind(8 * depth.itemsize - 1)
    return np.where(bits & sign, ~bits, bits | sign)


def _wrapped(index, n):
    i = int(index)
    if not -n <= i < n:
        raise IndexError(f"index {i} is out of range for {n}")
    return i % n
