"""Per-pixel fragment lists."""

import json
import operator

import numpy as np

from . import _check, _core
from .errors import ParameterError, SceneError, UnsupportedError
from .padded import Padded, pad, unpad

METHODS = tuple(row[0] for row in _core.methods())


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
        background: straight, behind the lists: grey, (3|4,) or (H, W, 3|4).

    Raises:
        SceneError: arrays that do not fit together, a depth that is not finite, or a list that is not sorted.

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
        try:
            height, width = (operator.index(n) for n in shape)
        except (TypeError, ValueError):
            raise SceneError(f"shape must be (H, W), got {shape!r}") from None
        self.shape = (height, width)
        self.offsets = _integers("offsets", offsets, np.int64)
        self.depth = np.ascontiguousarray(_check.floats(_check.array_of_numbers("depth", depth, "fiu")))
        _check.first_bad("depth", ~np.isfinite(self.depth), self.depth, "depths must be finite")
        self.color = _check.straight_rgba("color", np.zeros((0, 4)) if np.size(color) == 0 else color)
        n = self.depth.size
        counts = np.diff(self.offsets)
        if self.offsets.shape != (height * width + 1,) or self.offsets[0] != 0 or (counts < 0).any():
            raise SceneError(f"offsets must be ({height * width + 1},) for shape {self.shape} and rise from 0")
        if self.offsets[-1] != n or self.depth.shape != (n,) or self.color.shape != (n, 4):
            raise SceneError(
                f"offsets end at {self.offsets[-1]}, but depth is {self.depth.shape} and color {self.color.shape}"
            )
        self.key = _orderable(self.depth) if key is None else _check.array_of_numbers("key", key, "u")
        if primitive is None:
            primitive = self.layer
        self.primitive = _integers("primitive", primitive, np.int32)
        if self.key.shape != (n,) or self.primitive.shape != (n,):
            raise SceneError(f"key and primitive must be ({n},), got {self.key.shape} and {self.primitive.shape}")
        unsorted = (np.diff(self.pixel) == 0) & (self.key[1:] < self.key[:-1])
        if unsorted.any():
            y, x = divmod(int(self.pixel[1:][unsorted][0]), width)
            raise SceneError(f"the list of pixel [{y}, {x}] is not sorted front to back")
        self.background = np.broadcast_to(_check.background(background, self.shape), (height, width, 4))
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
    def from_padded(cls, depth, color, *, primitive=None, background=(0, 0, 0, 0)):
        """From dense arrays, such as `to_padded` and other renderers give.

        Args:
            depth: (H, W, K), not finite where there is no fragment. The K need not be sorted.
            color: (H, W, K, 3|4) straight.
            primitive: (H, W, K) integers. None: 0 to K − 1. Of equal depths the greater is in front, as if
                painted last: give it, or ties come out in reverse.
            background: as in `Fragments`.
        """
        return cls(**unpad(depth, color, primitive), background=background)

    @property
    def counts(self) -> np.ndarray:
        """Fragments a pixel, (H, W) int32."""
        return np.diff(self.offsets).astype(np.int32).reshape(self.shape)

    @property
    def pixel(self) -> np.ndarray:
        """The pixel of each fragment, y·W + x, (F,) int64; of a slice, counted in the slice."""
        return np.repeat(np.arange(len(self.offsets) - 1), np.diff(self.offsets))

    @property
    def layer(self) -> np.ndarray:
        """How many fragments of its pixel are in front of each fragment, (F,) int64."""
        return np.arange(self.offsets[-1]) - np.repeat(self.offsets[:-1], np.diff(self.offsets))

    def __len__(self):
        return len(self.depth)

    def __repr__(self):
        height, width = self.shape
        return f"Fragments({height}×{width} pixels, {len(self)} fragments)"

    def __getitem__(self, index):
        if not (isinstance(index, tuple) and len(index) == 2):
            raise ParameterError(f"index with [y, x] or [y0:y1, x0:x1], got {index!r}")
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
            background: straight, grey, (3|4,) or (H, W, 3|4). None: the lists' own, with the opaque surfaces that
                are not in the lists; any other replaces those too, unless render got fragments="all".
        """
        _check.choice("method", method, METHODS)
        _check.arguments("composite", options, (), f"method {method!r}", ("method", "background"))
        background = self.background if background is None else _check.background(background, self.shape)
        image = np.ascontiguousarray(np.broadcast_to(background, (*self.shape, 4)), dtype=np.float64)
        return _core.composite(self.offsets, self.color, image).reshape(*self.shape, 4)

    def to_padded(self, k=None) -> Padded:
        """The k nearest fragments of each pixel as dense arrays. None: as many as the deepest pixel has."""
        return pad(self, k)

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

        At an edge they may leave [0, 1] by what snapping to 1/256 pixel moves it. A triangle that has no area on
        the screen before that gives (1, 0, 0).
        """
        from .scene import as_scene

        view, projection, ndc = self._rays(camera)
        result = np.empty((len(self), 3))
        triangles = as_scene(scene).triangles()
        if len(self) and not 0 <= self.primitive.min() <= self.primitive.max() < len(triangles):
            named = f"{self.primitive.min()} to {self.primitive.max()}"
            raise ParameterError(f"the lists name primitives {named}, the scene has {len(triangles)}: another scene?")
        to_clip = (projection @ view)[[0, 1, 3]]
        for start in range(0, len(self), 1 << 18):  # bounds the corners that are held at once
            part = slice(start, start + (1 << 18))
            clip = triangles[self.primitive[part]] @ to_clip[:, :3].T + to_clip[:, 3]
            # Relative to the pixel's ray, b is the null vector of the corners' (x, y): two cross products.
            x, y = (clip[..., i] - ndc[part, None, i] * clip[..., 2] for i in (0, 1))
            b = np.stack([x[:, i] * y[:, j] - x[:, j] * y[:, i] for i, j in ((1, 2), (2, 0), (0, 1))], axis=1)
            b[b.sum(axis=1) == 0] = 1, 0, 0
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
        """A table, one row a fragment: y, x, layer (0 in front), depth, r, g, b, a, primitive.

        y and x are those of the whole image, also where the lists are a slice of it.
        """
        try:
            import pandas as pd
        except ImportError as e:
            raise UnsupportedError("to_pandas needs pandas: pip install pandas") from e
        y, x = np.divmod(self.pixel, self.shape[1])
        y0, x0, *_ = self._window
        columns = {"y": y + y0, "x": x + x0, "layer": self.layer, "depth": self.depth}
        columns |= dict(zip("rgba", self.color.T, strict=True)) | {"primitive": self.primitive}
        return pd.DataFrame(columns)

    def save(self, path):
        """Writes an .npz that `load` reads."""
        with open(_check.path(path), "wb") as file:  # numpy would add an ending to the name
            np.savez_compressed(file, **self._arrays())

    @classmethod
    def load(cls, path):
        """Reads what `save` wrote."""
        return cls._from_arrays(read_npz(path), path)

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
    def _from_arrays(cls, arrays, path):
        wanted = {"shape", "offsets", "depth", "key", "color", "primitive", "background", "window"}
        missing = wanted - set(arrays)
        if missing:
            raise SceneError(f"{str(path)!r} holds no fragment lists: {', '.join(sorted(missing))} missing")
        fields = {f: arrays[f] for f in ("offsets", "depth", "color", "key", "primitive", "background")}
        self = cls(tuple(arrays["shape"]), **fields)
        self._window = tuple(int(v) for v in arrays["window"])
        return self


def read_npz(path) -> dict:
    """The arrays of an .npz. Only what the system refuses, a missing file say, stays an OSError."""
    try:
        with open(_check.path(path), "rb") as file, np.load(file, allow_pickle=False) as arrays:
            return dict(arrays)
    except (OSError, MemoryError):
        raise
    except Exception as e:  # numpy's, zipfile's and zlib's, whichever notices first
        raise ParameterError(f"{str(path)!r} is not an .npz that abuffer saved") from e


def _integers(name, values, dtype):
    """`values` as a contiguous array of `dtype`; empty ones of any kind will do."""
    array = np.zeros(0, dtype) if np.size(values) == 0 else _check.array_of_numbers(name, values, "iu")
    limits = np.iinfo(dtype)
    _check.first_bad(name, (array < limits.min) | (array > limits.max), array, f"not an {limits.dtype}")
    return np.ascontiguousarray(array, dtype)


def _orderable(depth):
    """Unsigned integers in the order of the depths; −0 counts as +0."""
    kind = np.uint32 if depth.dtype == np.float32 else np.uint64
    bits = (depth + 0).view(kind)
    sign = kind(1) << kind(8 * depth.itemsize - 1)
    return np.where(bits & sign, ~bits, bits | sign)


def _wrapped(index, n):
    try:
        i = operator.index(index)
    except TypeError:
        raise TypeError(f"index with integers or slices, got {index!r}") from None
    if not -n <= i < n:
        raise IndexError(f"index {i} is out of range for {n}")
    return i % n
