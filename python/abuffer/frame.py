"""What a render returns."""

import json
import os
import warnings
from dataclasses import asdict, dataclass, field

import numpy as np

from . import _check, _core, archive
from ._srgb import encode_srgb
from .camera import Camera
from .errors import ParameterError
from .fragments import Fragments


@dataclass(frozen=True)
class Stats:
    """What a render measured."""

    fragments: int  # of all pixels, before anything was skipped because it could not be seen
    max_depth_complexity: int | None  # fragments of the deepest pixel; None where counting would cost
    dropped_fragments: int  # 0 where exact
    rejected_triangles: int  # finite triangles whose transformed values are not
    bands: int  # parts that the image was rendered in, to stay within memory
    bytes: dict = field(default_factory=dict)  # held at most, per use
    ms: dict = field(default_factory=dict)  # per stage, in the order they ran
    device: str = ""
    # What a channel may be off by: for `max_error` in all; for `cutoff` beside the same render without it, and roundings
    # come on top.
    error_bound: float = 0.0
    merged_fragments: int = 0  # together with others, by a bounded method; 0 where exact
    gpu_ms: float | None = None  # from the first begin to the last end of a GPU's stages, where one submission has all

    def __str__(self):
        stages = ", ".join(f"{stage} {ms:.2f}" for stage, ms in self.ms.items())
        deepest = "" if self.max_depth_complexity is None else f", at most {self.max_depth_complexity} in a pixel"
        return f"{self.fragments:,} fragments{deepest}; ms: {stages}; on {self.device}"


class Plan(tuple):
    """Every choice that was made for a render, and why: rows of (what, choice, why)."""

    def __str__(self):
        return "\n".join(f"{what}: {choice} ({why})" for what, choice, why in self)

    __repr__ = __str__

    def __getitem__(self, index):
        if isinstance(index, str):
            choices = {what: choice for what, choice, _ in self}
            if index not in choices:
                raise KeyError(f"the plan has no row {index!r}: it has {', '.join(choices)}")
            return choices[index]
        return super().__getitem__(index)


@dataclass(frozen=True, repr=False, eq=False)
class Frame:
    """An image and the fragment lists behind it.

    Attributes:
        image: (H, W, 4) float32, or float64 if asked for; row 0 on top, premultiplied, over the background. With
            msaa_resolve="none" the samples, (H, W, samples, 4).
        counts: (H, W) int32 fragments a pixel, None unless render got fragments=True, "all" or "count".
        fragments: the lists, None unless render got fragments=True or "all".
        stats: what was measured.
        plan: what was chosen, and why.
        error_bound: (H, W) float64, what each pixel may be off by at most in any channel, None unless render got max_error.
        camera: what it was seen by, of this image's size; later changes of a scene that `Camera.fit` looked at
            do not move it.
    """

    image: np.ndarray
    counts: np.ndarray | None
    fragments: Fragments | None
    stats: Stats
    plan: Plan
    camera: Camera | None = None
    error_bound: np.ndarray | None = None

    def __repr__(self):
        height, width, *samples, _ = self.image.shape
        return f"Frame({height}×{width}{f' of {samples[0]} samples' if samples else ''}, {self.stats})"

    @property
    def straight(self) -> np.ndarray:
        """The image with alpha divided out, of its shape: for imshow, PIL and PNG. 0 where alpha is 0."""
        alpha = self.image[..., 3:]
        rgb = np.divide(self.image[..., :3], alpha, out=np.zeros_like(self.image[..., :3]), where=alpha > 0)
        return np.concatenate([rgb, alpha], axis=-1)

    def to_uint8(self, srgb=False, background=None) -> np.ndarray:
        """For display: (H, W, 4) uint8, straight. Samples are averaged first.

        Args:
            srgb: encode RGB with the sRGB transfer function; give it if your colours are linear light.
            background: straight, grey, (3|4,) or (H, W, 3|4), put behind the image first.

        Where colour exceeds alpha, straight RGBA cannot hold it: the image is then put over black, with a
        warning. Colours over 1 are cut to 1, with a warning.
        """
        image = self.image.astype(np.float64)
        if image.ndim == 4:
            image = image.mean(axis=2)
        if background is not None:
            behind = _check.background(background, image.shape[:2])
            behind = np.concatenate([behind[..., :3] * behind[..., 3:], behind[..., 3:]], axis=-1)
            image = image + (1 - image[..., 3:]) * behind
        rgb, alpha = image[..., :3], image[..., 3:]
        # A few roundings over are no excess.
        excess = (rgb > alpha * (1 + 1e-5) + 1e-7).any(axis=-1, keepdims=True)
        if (excess & (alpha < 1)).any():
            warnings.warn("colour exceeds alpha: shown over black", UserWarning, stacklevel=2)
            alpha = np.ones_like(alpha)
        elif excess.any():
            warnings.warn("colour exceeds 1: shown as 1", UserWarning, stacklevel=2)
        rgb = np.divide(rgb, alpha, out=np.zeros_like(rgb), where=alpha > 0)
        rgb = np.clip(rgb, 0, 1)
        if srgb:
            rgb = encode_srgb(rgb)
        return np.rint(np.concatenate([rgb, np.clip(alpha, 0, 1)], axis=-1) * 255).astype(np.uint8)

    def save(self, path, *, srgb=False, background=None):
        """Writes a .png (see `to_uint8`) or an .npz with everything, which `load` reads."""
        path = _check.path(path)
        ending = os.path.splitext(path)[1].lower()
        if ending == ".png":
            png = _core.encode_png(self.to_uint8(srgb, background))
            with open(path, "wb") as file:
                file.write(png)
        elif ending == ".npz":
            if srgb or background is not None:
                raise ParameterError("srgb and background are for .png; an .npz holds the numbers as they are")
            arrays = {"image": self.image, "stats": np.array(json.dumps(asdict(self.stats)))}
            arrays["plan"] = np.array(json.dumps(list(self.plan)))
            if self.camera is not None:
                fields = {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in self.camera._fields().items()}
                arrays["camera"] = np.array(json.dumps(fields))  # whose floats come back as they were
            if self.counts is not None:
                arrays["counts"] = self.counts
            if self.fragments is not None:
                arrays |= {f"fragments_{k}": v for k, v in self.fragments._arrays().items()}
            with open(path, "wb") as file:
                np.savez_compressed(file, **arrays)
        else:
            raise ParameterError(f"a frame saves as .png or .npz, got {path!r}")

    @classmethod
    def load(cls, path):
        """Reads an .npz that `save` wrote."""
        arrays = archive.read_npz(path)
        missing = {"image", "stats", "plan"} - set(arrays)
        if missing:
            raise ParameterError(f"{str(path)!r} holds no frame: {', '.join(sorted(missing))} missing")
        prefix = "fragments_"
        lists = {k[len(prefix) :]: arrays[k] for k in arrays if k.startswith(prefix)}
        return cls(
            arrays["image"],
            arrays.get("counts"),
            Fragments._from_arrays(lists, path) if lists else None,
            Stats(**json.loads(str(arrays["stats"]))),
            Plan(tuple(row) for row in json.loads(str(arrays["plan"]))),
            Camera._made(**json.loads(str(arrays["camera"]))) if "camera" in arrays else None,
        )

    def _repr_png_(self):
        return _core.encode_png(self.to_uint8())
