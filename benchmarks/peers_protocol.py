"""What is said to a peer, and what it says back: a scene in a file, and its image and times in another.

`peers/worker.py` is the other end, and says what a peer is.
"""

import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from abuffer.diagnosis import decode_srgb
from peers_environment import python_of, run

PEERS = Path(__file__).resolve().parent / "peers"
WORKER = PEERS / "worker.py"
# Of the depths of a scene, what near and far are away from it: nothing is cut, and 24 bits of depth tell it apart.
SLACK = 0.05
# Where a scene reaches the eye, near is so much of far.
NEAREST = 1e-3


@dataclass(frozen=True)
class Drawn:
    """What a peer drew."""

    image: np.ndarray  # (H, W, 4) float64, linear; of 3 channels alpha is 1
    covered: np.ndarray  # (H, W) bool: pixels that show a surface
    ms: list  # of each frame that was timed
    version: str
    device: str
    notes: str


def arrays_of(scene, camera, size, background, origins=None) -> dict:
    """A scene as peers take it: all colours a vertex, positions in the world.

    Args:
        scene: Scene of triangles that are blended by "over", or opaque.
        size: (width, height), pixels.
        background: straight RGB, and perhaps an alpha, which must be 1.
        origins: (3,) a mesh, by which a renderer may sort them. None: the middles of their bounds.

    Raises:
        RuntimeError: peers cannot draw that.
    """
    if len(background) > 3 and background[3] != 1:
        raise RuntimeError(f"peers draw before an opaque background, and its alpha is {background[3]}")
    view, projection = camera.matrices(*size)
    near, far = _range(scene, view, camera.is_perspective)
    if camera.is_perspective:
        projection[2, 2:] = (far + near) / (near - far), 2 * far * near / (near - far)
    else:
        projection[2, 2:] = 2 / (near - far), (far + near) / (near - far)
    arrays = {
        "size": np.array(size),
        "background": np.array(background[:3], np.float64),
        "view": view,
        "projection": projection,
        "range": np.array([near, far]),
        "mesh_count": np.array(len(scene.meshes)),
    }
    for i, mesh in enumerate(scene.meshes):
        if mesh.blend != "over" or mesh.cull or mesh.alpha_cutoff is not None:
            raise RuntimeError(f"peers draw both sides, blended by over alone: mesh {i} is {mesh!r}")
        positions, faces, colors = _by_vertex(mesh)
        origin = (positions.min(axis=0) + positions.max(axis=0)) / 2 if origins is None else origins[i]
        arrays |= {
            f"positions_{i}": positions.astype(np.float32),
            f"faces_{i}": faces,
            f"colors_{i}": colors,
            f"opaque_{i}": np.array(mesh.opaque),
            f"origin_{i}": np.array(origin, np.float64),
        }
    return arrays


def drawn(peer, variant, arrays, *, repeats=5, timeout=300.0, wheels=None) -> Drawn:
    """What the script `peer` makes of a scene, in its environment.

    Args:
        peer: path of its script, or a name of one in `peers`.
        variant: text, which it knows.
        arrays: those of `arrays_of`.
        repeats: frames that are timed.
        timeout: seconds for all of them.

    Raises:
        RuntimeError: it cannot, with its stderr; or what it gives back is no image of the scene's size.
    """
    path = PEERS / f"{peer}.py" if not Path(peer).suffix else Path(peer).resolve()
    python = python_of(path, wheels)
    with tempfile.TemporaryDirectory() as folder:
        scene_file, drawn_file = Path(folder, "scene.npz"), Path(folder, "drawn.npz")
        np.savez(scene_file, **arrays)
        run([python, "-I", WORKER, path, variant, str(repeats), scene_file, drawn_file], timeout)
        with np.load(drawn_file) as data:
            found = dict(data)
    width, height = arrays["size"]
    image, white = (_floats(path, found[name], width, height) for name in ("image", "white"))
    said = {name: str(found[name]) for name in ("version", "device", "notes")}
    covered = white[..., :3].max(axis=2) > 0.5
    return Drawn(decoded(image) if found["srgb"] else image, covered, found["ms"].tolist(), **said)


def decoded(image):
    """sRGB to linear light; alpha is linear."""
    return np.concatenate([decode_srgb(image[..., :3]), image[..., 3:]], axis=2)


def _floats(path, image, width, height):
    if image.ndim != 3 or image.shape[:2] != (height, width) or image.shape[2] not in (3, 4):
        raise RuntimeError(f"{path.name} drew an image of shape {image.shape}: asked was ({height}, {width}, 3 or 4)")
    image = image / 255 if image.dtype == np.uint8 else image.astype(np.float64)
    return image if image.shape[2] == 4 else np.concatenate([image, np.ones((height, width, 1))], axis=2)


def _by_vertex(mesh):
    """Positions, faces and colours a vertex; corners of their own where faces differ in colour."""
    if mesh.color_mode in ("one", "vertex") and mesh.faces is not None:
        return mesh.positions, mesh.faces, np.broadcast_to(mesh.colors, (len(mesh.positions), 4)).astype(np.float32)
    count = mesh.face_count
    colors = mesh.colors[:, None] if mesh.color_mode == "face" else mesh.colors
    if mesh.color_mode == "vertex":
        colors = colors.reshape(count, 3, 4)
    colors = np.broadcast_to(colors, (count, 3, 4)).reshape(-1, 4)
    faces = np.arange(3 * count, dtype=np.uint32).reshape(-1, 3)
    return mesh.triangles().reshape(-1, 3), faces, colors.astype(np.float32)


def _range(scene, view, is_perspective):
    """Eye depths before and behind all triangles."""
    depth = -(scene.triangles().reshape(-1, 3) @ view[2, :3] + view[2, 3])
    low, high = depth.min(), depth.max()
    pad = SLACK * (high - low) + NEAREST * abs(high)
    near, far = low - pad, high + pad
    return (max(near, NEAREST * far), far) if is_perspective else (near, far)
