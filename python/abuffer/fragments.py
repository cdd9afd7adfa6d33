"""Per-pixel fragment lists."""

import operator

import numpy as np

from . import _check, _core, _methods, archive, columns, cutoff, geometry, inspecting, options, own_methods, painter
from .blend import BLENDS, composite, require, resolve
from .camera import Camera
from .errors import ParameterError, SceneError
from .extras import needed
from .padded import Padded, pad, unpad
from .scene import as_scene

# Of every method, and of exact alone.
OPTIONS = ("msaa_resolve",)
EXACT_OPTIONS = (*OPTIONS, "blend_order", "cutoff")
FIELDS = ("depth", "color", "primitive", "key", "coverage", "blend")  # of the fragments; the last two may be None


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
        primitive: (F,) int32, the order of submission. None: counted from 0 in each pixel, so front to back, which is
            the best case of methods that stream.
        background: straight, behind the lists: grey, (3|4,) or (H, W, 3|4), or with several samples
            (H, W, samples, 3|4). Kept as (H, W, 4) or (H, W, samples, 4).
        coverage: (F,) uint32 masks of the samples that a fragment covers, bit s for sample s of the standard
            pattern. None: all of them; it stays None where there is one sample.
        blend: (F,) uint8, how a fragment blends: an index in `abuffer.BLENDS`, or 5 + an index in `blends`. None: over.
        samples: a pixel: 1, 2, 4, 8 or 16.
        blends: the `Blend`s that ids of 5 and more name.

    Raises:
        SceneError: arrays that do not fit together, a depth that is not finite, or a list that is not sorted.

    >>> frags = Fragments((1, 1), [0, 2], [1., 2.], [[1, 0, 0, .5], [0, 1, 0, .5]])
    >>> frags.composite()[0, 0].tolist()
    [0.5, 0.25, 0.0, 0.75]
    >>> frags[0, 0].depth.tolist()
    [1.0, 2.0]
    """

    def __init__(
        self,
        shape,
        offsets,
        depth,
        color,
        key=None,
        primitive=None,
        background=(0, 0, 0, 0),
        coverage=None,
        blend=None,
        samples=1,
        blends=(),
    ):
        try:
            height, width = (operator.index(n) for n in shape)
        except (TypeError, ValueError):
            raise SceneError(f"shape must be (H, W), got {shape!r}") from None
        self.shape = (height, width)
        self.offsets = columns.integers("offsets", offsets, np.int64)
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
        self.key = columns.orderable(self.depth) if key is None else _check.array_of_numbers("key", key, "u")
        if primitive is None:
            primitive = self.layer
        self.primitive = columns.integers("primitive", primitive, np.int32)
        if self.key.shape != (n,) or self.primitive.shape != (n,):
            raise SceneError(f"key and primitive must be ({n},), got {self.key.shape} and {self.primitive.shape}")
        unsorted = (np.diff(self.pixel) == 0) & (self.key[1:] < self.key[:-1])
        if unsorted.any():
            y, x = divmod(int(self.pixel[1:][unsorted][0]), width)
            raise SceneError(f"the list of pixel [{y}, {x}] is not sorted front to back")
        self.samples = options.samples(samples)
        self.coverage = columns.masks(coverage, n, self.samples)
        self.blends = columns.as_blends(blends)
        self.blend = columns.modes(blend, self.color, self.blends)
        self.background = self._behind(_check.background(background, self.shape, self.samples))
        self._window = (0, 0, height, width)

    @classmethod
    def _of(cls, shape, parts, background, samples=1, blends=()):
        """From the core's arrays, which are known to be sound."""
        self = cls.__new__(cls)
        self.shape, self.samples, self.blends = shape, samples, blends
        self.offsets = parts["offsets"]
        for name in FIELDS:
            setattr(self, name, parts.get(name))
        self.background = self._behind(background)
        self._window = (0, 0, *shape)
        return self

    def _behind(self, background):
        """A background in any of its shapes as (H, W, 4), or (H, W, samples, 4) with several samples."""
        if self.samples == 1:
            return np.broadcast_to(background, (*self.shape, 4))
        if background.ndim == 3:
            background = background[:, :, None]
        return np.broadcast_to(background, (*self.shape, self.samples, 4))

    @classmethod
    def from_padded(
        cls,
        depth,
        color,
        *,
        primitive=None,
        background=(0, 0, 0, 0),
        coverage=None,
        blend=None,
        samples=1,
        blends=(),
    ):
        """From dense arrays, such as `to_padded` and other renderers give.

        Args:
            depth: (H, W, K), not finite where there is no fragment. The K need not be sorted.
            color: (H, W, K, 3|4) straight.
            primitive: (H, W, K) integers, the order of submission. None: 0 to K − 1, that of the columns as they are given.
                Of equal depths the greater is in front, as if painted last: give it, or ties come out in reverse. Methods
                that stream see fragments by it: columns that are sorted front to back, as those of `to_padded`, are what
                they do best.
            coverage, blend: (H, W, K) integers, as in `Fragments`.
            background, samples, blends: as in `Fragments`.
        """
        lists = unpad(depth, color, primitive, coverage, blend)
        return cls(**lists, background=background, samples=samples, blends=blends)

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
        samples = "" if self.samples == 1 else f" of {self.samples} samples"
        return f"Fragments({height}×{width} pixels{samples}, {len(self)} fragments)"

    def __getitem__(self, index):
        if not (isinstance(index, tuple) and len(index) == 2):
            raise ParameterError(f"index with [y, x] or [y0:y1, x0:x1], got {index!r}")
        if any(isinstance(i, slice) for i in index):
            return self._cropped(index)
        y, x = (_wrapped(i, n) for i, n in zip(index, self.shape, strict=True))
        pixel = y * self.shape[1] + x
        part = slice(self.offsets[pixel], self.offsets[pixel + 1])
        present = self._present()
        dtype = [(name, values.dtype, values.shape[1:]) for name, values in present.items()]
        records = np.recarray(part.stop - part.start, dtype=dtype)
        for name, values in present.items():
            records[name] = values[part]
        return records

    def _present(self) -> dict:
        """What is known of each fragment, by name."""
        fields = {name: getattr(self, name) for name in FIELDS}
        return {name: values for name, values in fields.items() if values is not None}

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
        parts = {name: values[taken] for name, values in self._present().items()} | {"offsets": offsets}
        behind = self.background[y0:y1, x0:x1]
        crop = Fragments._of((y1 - y0, x1 - x0), parts, behind, self.samples, self.blends)
        oy, ox, height, width = self._window
        crop._window = (oy + y0, ox + x0, height, width)
        return crop

    def composite(self, method="exact", background=None, **chosen) -> np.ndarray:
        """The image of these lists, (H, W, 4) float64, premultiplied.

        Args:
            method: one of `abuffer.methods()`. What is streamed comes by primitive, rising.
            background: straight, grey, (3|4,), (H, W, 3|4), or with several samples (H, W, samples, 3|4). None: the
                lists' own, with the opaque surfaces that are not in the lists; any other replaces those too, unless
                render got fragments="all".
            msaa_resolve: "per_pixel" (default), "per_sample", "hdr", or "none" for (H, W, samples, 4), as in `render`.
            blend_order: "front_to_back" (default) or "back_to_front", as in `render`. Lists with a `Blend` are
                composited back to front by its `numpy` in any case.
            cutoff: as in `render`: no channel changes by more than this; 0 by default.
            scene, camera: what the lists are of, for methods that sort objects or triangles.
            chosen: of other methods msaa_resolve and their own parameters, as `abuffer.methods()` lists them. Those that
                normalise depths do so by depth_range=(nearest, farthest); None, the default: by the lists' own.

        Raises:
            ParameterError: an option that is none of these, or a `Blend` without `numpy`.
        """
        others = EXACT_OPTIONS if method == "exact" else OPTIONS
        # What is sorted before it is rasterised needs to be seen.
        if method in _methods.METHODS and _methods.METHODS[method].sorts:
            others = (*others, "scene", "camera")
        how = _methods.chosen(method, chosen, others, "composite", ("method", "background"))
        msaa_resolve = _check.choice("msaa_resolve", chosen.get("msaa_resolve", "per_pixel"), options.MSAA_RESOLVES)
        order = _check.choice("blend_order", chosen.get("blend_order", "front_to_back"), options.BLEND_ORDERS)
        behind = self.background
        if background is not None:
            behind = self._behind(_check.background(background, self.shape, self.samples))
        behind = np.ascontiguousarray(behind, dtype=np.float64)
        modes = self._modes()
        how.refuse_modes(modes)
        settings = {"samples": self.samples, "msaa_resolve": msaa_resolve, "blend_order": order}
        stop = cutoff.checked(chosen.get("cutoff", 0))
        least = cutoff.least_transmittance(stop, modes, (self.color, behind), settings, self.samples)
        own_methods.require(how, "numpy", "compositing lists")
        nearest, farthest = (float(self.depth.min()), float(self.depth.max())) if len(self) else (0.0, 0.0)
        if self.blend is not None and (self.blend >= len(BLENDS)).any():
            image = self._by_layers(msaa_resolve, behind)
        elif how.method.numpy is not None:
            image = resolve(self._by_function(how, behind, (nearest, farthest)), msaa_resolve)
        else:
            lists = {name: getattr(self, name) for name in ("offsets", "color", "primitive", "coverage", "blend")}
            y0, x0, *_ = self._window
            if how.method.sorts:
                lists["primitive"] = self._painted(how, chosen)
            settings |= {
                "method": how.parts(nearest, farthest),
                "least_transmittance": least,
                "window": (x0, y0, self.shape[1]),
            }
            image = _core.composite(lists | {"depth": self.depth.astype(np.float64)}, settings, behind.reshape(-1, 4))
        each = (self.samples,) if msaa_resolve == "none" else ()
        return image.reshape(*self.shape, *each, 4)

    def _modes(self) -> list:
        """The modes other than over that the lists hold; of Blends, that there are some."""
        ids = () if self.blend is None else np.unique(self.blend)
        return ["a Blend" if i >= len(BLENDS) else BLENDS[i] for i in ids if i != 0]

    def _by_layers(self, msaa_resolve, behind=None, kept=None):
        """`composite` in numpy, for lists that a user's own Blends are in: (H·W, 4) or (H·W, samples, 4).

        Args:
            behind: the background. None: the lists' own.
            kept: (F,) bool, the fragments to composite. None: all.
        """
        behind = self.background if behind is None else behind
        own = columns.as_blends(self.blends)  # which may have been set anew
        columns.modes(self.blend, self.color, own)
        require(own, "numpy", "compositing lists")
        names = ("color", "depth", "coverage", "blend")
        offsets, lists = self.offsets, [getattr(self, name) for name in names]
        if kept is not None:
            offsets = np.concatenate([[0], np.cumsum(kept)])[offsets]
            lists = [None if values is None else values[kept] for values in lists]
        samples = composite(offsets, *lists, behind.reshape(-1, self.samples, 4), own)
        return resolve(samples, msaa_resolve)

    def _by_function(self, how, behind, depths):
        """Samples (H·W, samples, 4) that a method's function of arrays makes."""
        lists = (self.offsets, self.color, self.depth, self.primitive, self.coverage)
        return own_methods.composite(how, *lists, behind.reshape(-1, self.samples, 4), depths, self.shape[1])

    def _painted(self, how, chosen):
        """(F,) int32, when each fragment's triangle is painted."""
        method, key = how.method, how.parameters["key"]
        scene, camera = chosen.get("scene"), chosen.get("camera")
        if scene is None or camera is None:
            raise ParameterError(
                f"method {method.id!r} sorts {method.sorts}, which lists do not hold: give scene= and camera= too"
            )
        if not isinstance(camera, Camera):
            raise ParameterError(f"camera must be an abuffer.Camera, got {type(camera).__name__}")
        scene = as_scene(scene)
        ranks = painter.ranks(scene, camera, method.sorts, key)
        geometry.check_primitives(self, len(ranks))
        return ranks[self.primitive].astype(np.int32)

    def to_padded(self, k=None) -> Padded:
        """The k nearest fragments of each pixel as dense arrays. None: as many as the deepest pixel has."""
        return pad(self, k)

    def points(self, camera) -> np.ndarray:
        """World positions of the fragments, (F, 3) float64: on the ray through the pixel's centre, at their depth.

        With several samples, a fragment that does not cover the centre has the depth of its lowest covered sample;
        which fragments those are, a mask does not tell, and the ray is the centre's all the same.
        """
        return geometry.points(self, camera)

    def barycentric(self, scene, camera) -> np.ndarray:
        """Perspective-correct barycentric coordinates of the pixel's centre in each fragment's triangle, (F, 3) float64.

        At an edge they may leave [0, 1] by what snapping to 1/256 pixel moves it; with several samples by up to half
        a pixel, where a triangle covers samples but not the centre. A triangle that has no area on the screen before
        that gives (1, 0, 0).
        """
        return geometry.barycentric(self, scene, camera)

    def plot(self, y, x, ax=None, *, srgb=False):
        """The fragments of a pixel as a stack, the nearest 64 of them, the nearest on top. Needs matplotlib.

        Of each the colour, over checks and at the right end opaque, depth, alpha, straight RGB, the transmittance T in front of it,
        and its weight Tα; of other blend modes than over the mode in place of these two.

        Args:
            ax: axes to draw into. None: a new figure.
            srgb: encode what is shown with the sRGB curve; give it if your colours are linear light.

        Returns the matplotlib Figure, which pyplot does not know of.
        """
        return inspecting.layers(self, y, x, ax, _check.flag("srgb", srgb))

    def to_pandas(self):
        """A table, one row a fragment: y, x, layer (0 in front), depth, r, g, b, a, primitive, and coverage and
        blend (the mode's name) where there are such.

        y and x are those of the whole image, also where the lists are a slice of it.
        """
        pandas = needed("pandas", "to_pandas")
        y, x = np.divmod(self.pixel, self.shape[1])
        y0, x0, *_ = self._window
        table = {"y": y + y0, "x": x + x0, "layer": self.layer, "depth": self.depth}
        table |= dict(zip("rgba", self.color.T, strict=True)) | {"primitive": self.primitive}
        if self.coverage is not None:
            table["coverage"] = self.coverage
        if self.blend is not None:
            names = np.array([*BLENDS, *(own.name or repr(own) for own in self.blends)], dtype=object)
            table["blend"] = names[self.blend]
        return pandas.DataFrame(table)

    def save(self, path):
        """Writes an .npz that `load` reads."""
        with open(_check.path(path), "wb") as file:  # numpy would add an ending to the name
            np.savez_compressed(file, **self._arrays())

    @classmethod
    def load(cls, path):
        """Reads what `save` wrote.

        A file keeps the WGSL text of Blends, not their callables: set `blends` anew to composite such lists.
        """
        return cls._from_arrays(archive.read_npz(path), path)

    def _arrays(self):
        return archive.to_arrays(self)

    @classmethod
    def _from_arrays(cls, arrays, path):
        fields, window = archive.from_arrays(arrays, path)
        self = cls(**fields)
        self._window = window
        return self


def _wrapped(index, n):
    try:
        i = operator.index(index)
    except TypeError:
        raise TypeError(f"index with integers or slices, got {index!r}") from None
    if not -n <= i < n:
        raise IndexError(f"index {i} is out of range for {n}")
    return i % n
