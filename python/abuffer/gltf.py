"""glTF files, made ready for a reader that is not careful with them."""

import json
from pathlib import Path
from typing import NamedTuple

import numpy as np


class Prepared(NamedTuple):
    """A glTF file whose nodes and materials are named after their index, and what those said."""

    data: bytes
    kind: str  # "glb" or "gltf"
    names: list[str]  # of the nodes
    materials: list[dict]  # and at the end an empty one, which primitives without a material have


def prepared(path: str) -> Prepared:
    """The file with nodes and materials renamed to their index, and with a material everywhere.

    trimesh rounds colours to eight bits, reorders nodes and makes up names: with these names, what comes out of
    it is found again in the file.
    """
    data = Path(path).read_bytes()
    binary = data[:4] == b"glTF"
    end = 20 + int.from_bytes(data[12:16], "little")
    gltf = json.loads(data[20:end] if binary else data)
    gltf.pop("images", None)
    nodes, materials = gltf.get("nodes", []), [*gltf.get("materials", []), {}]
    names = [node.get("name", f"node_{index}") for index, node in enumerate(nodes)]
    for index, node in enumerate(nodes):
        node["name"] = str(index)
        node.pop("camera", None)
    gltf["materials"] = [{"name": str(index)} for index in range(len(materials))]
    for mesh in gltf.get("meshes", []):
        for primitive in mesh["primitives"]:
            primitive.setdefault("material", len(materials) - 1)
    text = json.dumps(gltf).encode()
    if binary:
        text += b" " * (-len(text) % 4)
        sizes = [20 + len(text) + len(data) - end, len(text)]
        text = data[:8] + np.array(sizes, "<u4").tobytes() + data[16:20] + text + data[end:]
    return Prepared(text, "glb" if binary else "gltf", names, materials)
