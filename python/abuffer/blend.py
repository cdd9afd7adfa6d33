"""How a fragment changes what lies behind it: the blend modes, and blends of a user's own.

Everything here goes from the farthest fragment to the nearest and works for any blend. Lists of the named modes alone
are composited by the core.
"""

import numpy as np

from . import _check, _core
from .errors import ParameterError

BLENDS = ("over", "additive", "multiply", "screen", "premultiplied")
AT_MOST_ONE = ("multiply", "screen")  # more than 1 would make what lies behind negative, or brighter by multiplying
MOST_OWN = 11  # ids have 4 bits
LONGEST_TEXT = 4000  # of a WGSL blend: a compiler recurses into what is nested


class Blend:
    """A blend of your own: what colour a fragment makes of the colour behind it.

    A scene that has one is blended from the farthest fragment to the nearest. GPUs need `wgsl`, the CPU `numpy`.

    Args:
        wgsl: a WGSL expression, or a function's body with its `return`. In scope are `dst: vec3f`, the colour behind,
            premultiplied; `src: vec4f`, the fragment's straight RGBA; `depth: f32`, its eye depth in world units.
            A vec3f is the new colour, and the alpha behind stays; a vec4f is new premultiplied colour and alpha.
        numpy: the same for n fragments at once, in float64: f(dst (n, 3), src (n, 4), depth (n,)) gives (n, 3) or
            (n, 4), all finite. None of the n lies in front of another.
        name: for people.

    Raises:
        ParameterError: neither is given, or not as text and a callable.
        ShaderError: `wgsl` is no WGSL; names its line.

    >>> lighten = Blend("max(dst, src.rgb)", lambda dst, src, depth: np.maximum(dst, src[:, :3]), "lighten")
    >>> lighten
    Blend('lighten', wgsl='max(dst, src.rgb)', numpy=<lambda>)
    """

    __slots__ = ("name", "numpy", "wgsl")

    def __init__(self, wgsl=None, numpy=None, name=None):
        if wgsl is None and numpy is None:
            raise ParameterError("a Blend needs wgsl (for GPUs), numpy (for the CPU) or both")
        if wgsl is not None and (not isinstance(wgsl, str) or not wgsl.strip()):
            hint = ": give a callable as numpy=" if callable(wgsl) else ""
            raise ParameterError(f"wgsl must be the text of a WGSL expression or function body, got {wgsl!r}{hint}")
        if wgsl is not None and (len(wgsl) > LONGEST_TEXT or not _is_unicode(wgsl)):
            raise ParameterError(f"wgsl must be Unicode text of at most {LONGEST_TEXT} characters, got {len(wgsl)}")
        if numpy is not None and not callable(numpy):
            raise ParameterError(f"numpy must be a callable of (dst, src, depth), got {numpy!r}")
        if name is not None and not isinstance(name, str):
            raise ParameterError(f"name must be text, got {name!r}")
        if wgsl is not None:
            _core.check_blend(name or "blend", wgsl)
        self._set(wgsl, numpy, name)

    def _set(self, wgsl, numpy, name):
        for field, value in (("wgsl", wgsl), ("numpy", numpy), ("name", name)):
            object.__setattr__(self, field, value)
        return self

    @classmethod
    def _loaded(cls, wgsl, name):
        """From a file, which cannot hold a callable: there may be neither."""
        return cls.__new__(cls)._set(wgsl, None, name)

    def __setattr__(self, field, value=None):
        raise AttributeError(f"a Blend is read-only: make another with another {field}")

    __delattr__ = __setattr__

    def __reduce__(self):
        return _rebuild, (self.wgsl, self.numpy, self.name)

    def __eq__(self, other):
        """Whether both do the same: the same text, the very same callable."""
        if not isinstance(other, Blend):
            return NotImplemented
        return self.wgsl == other.wgsl and self.numpy is other.numpy

    def __hash__(self):
        return hash((self.wgsl, id(self.numpy)))

    def __repr__(self):
        parts = [repr(self.name)] if self.name else []
        if self.wgsl is not None:
            text = " ".join(self.wgsl.split())
            parts.append(f"wgsl={text if len(text) <= 60 else text[:59] + '…'!r}")
        if self.numpy is not None:
            parts.append(f"numpy={getattr(self.numpy, '__name__', None) or type(self.numpy).__name__}")
        return f"Blend({', '.join(parts)})"

    def _of_arrays(self, dst, src, depth):
        """What `numpy` makes of float64 dst (n, 3), src (n, 4) and depth (n,): (n, 3) or (n, 4), checked."""
        name = f"what numpy of {self!r} returns"
        result = _check.array_of_numbers(name, self.numpy(dst, src, depth), "fiu", ParameterError)
        n = len(src)
        if result.shape not in ((n, 3), (n, 4)):
            raise ParameterError(f"{name} must be of shape (n, 3) or (n, 4), here with n = {n}, got {result.shape}")
        result = result.astype(np.float64)
        _check.first_bad(name, ~np.isfinite(result), result, "colours must be finite", ParameterError)
        return result


def _is_unicode(text):
    try:
        text.encode()
    except UnicodeEncodeError:  # half of a surrogate pair
        return False
    return True


def _rebuild(wgsl, numpy, name):
    return Blend.__new__(Blend)._set(wgsl, numpy, name)


def checked(blend):
    """`blend` if it is a Blend or the name of a mode, else a ParameterError."""
    if isinstance(blend, Blend):
        return blend
    try:
        return _check.choice("blend", blend, BLENDS)
    except ParameterError as e:
        raise ParameterError(f"{e}; a blend of your own is an abuffer.Blend") from None


def own_blends(blends) -> tuple:
    """The distinct Blends of `blends`, in the order of their ids: that of their first use."""
    own = tuple(dict.fromkeys(blend for blend in blends if isinstance(blend, Blend)))
    if len(own) > MOST_OWN:
        raise ParameterError(
            f"a scene may have at most {MOST_OWN} different Blends, got {len(own)}: "
            "give meshes that blend alike the same Blend"
        )
    return own


def id_of(blend, own) -> int:
    """The id of a mode, or of one of a scene's own Blends."""
    return BLENDS.index(blend) if isinstance(blend, str) else len(BLENDS) + own.index(blend)


def require(own, attribute, device):
    """Raises a ParameterError unless all Blends have `wgsl`, which a GPU needs, or `numpy`, which the CPU does."""
    for blend in own:
        if getattr(blend, attribute) is None:
            give = {
                "numpy": "numpy=f with f(dst (n, 3), src (n, 4), depth (n,)) -> (n, 3)",
                "wgsl": 'wgsl="…", an expression of dst, src and depth',
            }[attribute]
            raise ParameterError(f"{device} needs {attribute} of every Blend, and {blend!r} has none: give {give}")


def over_one(color, needed, name, error):
    """Raises `error` where a colour (..., 4) is over 1 in RGB and `needed` (..., or a bool) says it may not be."""
    bad = (color > 1) & np.expand_dims(needed, -1)
    why = f"blend modes {' and '.join(AT_MOST_ONE)} take RGB in [0, 1]"
    _check.first_bad(name, bad, color, why, error)


def composite(offsets, color, depth, coverage, mode, behind, own):
    """Lists of any blends over straight colours `behind` (P, S, 4), premultiplied (P, S, 4) float64, a sample each.

    Args:
        offsets, color, depth: the lists, front to back, as in `Fragments`.
        coverage: (F,) masks of the samples covered. None: all.
        mode: (F,) ids. None: all over.
        own: the Blends behind ids of 5 and more.
    """
    image = premultiplied(behind.astype(np.float64))
    mode = np.zeros(len(color), np.uint8) if mode is None else mode
    samples = np.arange(image.shape[1])
    for pixels, fragments in _layers(offsets):
        for each in np.unique(mode[fragments]):
            alike = mode[fragments] == each
            pixel, at = pixels[alike], fragments[alike]
            covers = np.ones((len(at), len(samples)), bool) if coverage is None else coverage[at, None] >> samples & 1
            row, sample = np.nonzero(covers)
            if len(row):
                at, where = at[row], (pixel[row], sample)
                image[where] = _onto(image[where], each, color[at].astype(np.float64), depth[at], own)
    return image


def _layers(offsets):
    """Yields (pixels, fragments): the farthest fragment of every pixel that has one, then the next nearer, ..."""
    counts = np.diff(offsets)
    pixels, k = np.flatnonzero(counts), 0
    while pixels.size:
        yield pixels, offsets[pixels + 1] - 1 - k
        k += 1
        pixels = pixels[counts[pixels] > k]


def _onto(dst, mode, src, depth, own):
    """Fragments of one mode (n, 4), straight, onto what lies behind them (n, 4), premultiplied."""
    d, a = dst[:, :3], dst[:, 3:]
    c, alpha = src[:, :3], src[:, 3:]
    if mode >= len(BLENDS):
        result = own[mode - len(BLENDS)]._of_arrays(d.copy(), src, depth.astype(np.float64))
        return result if result.shape[1] == 4 else np.concatenate([result, a], axis=1)
    light, through = alpha * c, 1 - alpha
    rgb = {
        "over": lambda: d * through + light,
        "additive": lambda: d + light,
        "multiply": lambda: d * (through + light),
        "screen": lambda: d * (1 - light) + light,
        "premultiplied": lambda: d * through + c,
    }[BLENDS[mode]]()
    raises = BLENDS[mode] in ("over", "premultiplied")
    return np.concatenate([rgb, a * through + alpha if raises else a], axis=1)


def premultiplied(straight):
    """Straight RGBA (..., 4) as a destination of blending."""
    return np.concatenate([straight[..., :3] * straight[..., 3:], straight[..., 3:]], axis=-1)


def resolve(samples, msaa_resolve):
    """The pixels (P, 4) of premultiplied samples (P, S, 4); "none": the samples."""
    if msaa_resolve == "none":
        return samples
    if samples.shape[1] == 1:
        return samples[:, 0]
    weight = np.ones_like(samples[..., :1])
    if msaa_resolve == "hdr":
        # A user's blend may make colours negative; what is bright is still what weighs less.
        weight = 1 / (1 + np.maximum(samples[..., :3].max(axis=-1, keepdims=True), 0))
    total, weights = 0.0, 0.0
    for sample in range(samples.shape[1]):  # in this order, as everywhere
        total = total + weight[:, sample] * samples[:, sample]
        weights = weights + weight[:, sample]
    return total / weights


def nearest_or_last(offsets, primitive, limit, policy):
    """(F,) bool: the `limit` fragments of each pixel that are nearest, or "last_submitted"."""
    counts = np.diff(offsets)
    rank = np.arange(offsets[-1]) - np.repeat(offsets[:-1], counts)
    if policy == "last_submitted":
        by_primitive = np.lexsort((-primitive.astype(np.int64), np.repeat(np.arange(len(counts)), counts)))
        rank[by_primitive] = rank.copy()
    return rank < limit
