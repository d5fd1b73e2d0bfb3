"""The boards from above as binary glTF 2.0, for globes and for Blender.

Axes are those of X3D: x to the east, y up, z to the south, in metres about the centre
of the box on the ground. Opacity is not multiplied into the colours.
"""

import json
import struct
from collections.abc import Mapping

import numpy as np

from .fields import AXES
from .meshes import Mesh


_MAGIC, _JSON, _BINARY = b"glTF", b"JSON", b"BIN\0"
_FLOAT, _UNSIGNED_INT = 5126, 5125
_VERTICES, _INDICES = 34962, 34963
_LINEAR, _CLAMP = 9729, 33071
_UNLIT = "KHR_materials_unlit"


def glb(parts: Mapping[str, tuple[Mesh, bytes]], about: Mapping[str, object]) -> bytes:
    """Make a file of meshes, each with its texture, drawn in this order.

    **Arguments:**

    - `parts`: mesh and PNG file by name; "ground" is opaque, others are not.
    - `about`: what the file says of itself.
    """
    file = _File()
    nodes = [
        {"name": name, "mesh": file.mesh(name, mesh, image)}
        for name, (mesh, image) in parts.items()
    ]
    document = {
        "asset": {"version": "2.0", "generator": about["generator"]},
        "extras": dict(about),
        "extensionsUsed": [_UNLIT],
        "scene": 0,
        "scenes": [{"nodes": list(range(len(nodes)))}],
        "nodes": nodes,
        "samplers": [
            {
                "magFilter": _LINEAR,
                "minFilter": _LINEAR,
                "wrapS": _CLAMP,
                "wrapT": _CLAMP,
            }
        ],
        "buffers": [{"byteLength": len(file.binary)}],
        **file.tables,
    }
    text = json.dumps(document, separators=(",", ":")).encode()
    chunks = b"".join(
        struct.pack("<I4s", len(content), kind) + content
        for kind, content in (
            (_JSON, text + b" " * (-len(text) % 4)),
            (_BINARY, bytes(file.binary)),
        )
    )
    return struct.pack("<4sII", _MAGIC, 2, 12 + len(chunks)) + chunks


class _File:
    """The tables of a file, which refer to each other by number, and its bytes."""

    def __init__(self):
        self.binary = bytearray()
        names = (
            "bufferViews",
            "accessors",
            "images",
            "textures",
            "materials",
            "meshes",
        )
        self.tables: dict[str, list] = {name: [] for name in names}

    def _add(self, table: str, entry: dict) -> int:
        self.tables[table].append(entry)
        return len(self.tables[table]) - 1

    def _view(self, content: bytes, **kind) -> int:
        start = len(self.binary)
        self.binary += content + bytes(-len(content) % 4)
        entry = {"buffer": 0, "byteOffset": start, "byteLength": len(content), **kind}
        return self._add("bufferViews", entry)

    def _accessor(self, values: np.ndarray, kind: str, number: int, **more) -> int:
        target = _INDICES if number == _UNSIGNED_INT else _VERTICES
        view = self._view(values.tobytes(), target=target)
        entry = {
            "bufferView": view,
            "componentType": number,
            "count": len(values),
            "type": kind,
            **more,
        }
        return self._add("accessors", entry)

    def mesh(self, name: str, mesh: Mesh, image: bytes) -> int:
        place = (mesh.place_m @ AXES.T).astype("<f4")
        # Textures of glTF begin at the upper left.
        texture = np.stack([mesh.texture[:, 0], 1 - mesh.texture[:, 1]], axis=-1)
        ends = {"min": place.min(0).tolist(), "max": place.max(0).tolist()}
        corners = mesh.corners.reshape(-1).astype("<u4")
        primitive = {
            "attributes": {
                "POSITION": self._accessor(place, "VEC3", _FLOAT, **ends),
                "TEXCOORD_0": self._accessor(texture.astype("<f4"), "VEC2", _FLOAT),
            },
            "indices": self._accessor(corners, "SCALAR", _UNSIGNED_INT),
            "material": self._material(name, image),
        }
        return self._add("meshes", {"name": name, "primitives": [primitive]})

    def _material(self, name: str, image: bytes) -> int:
        source = self._add(
            "images",
            {"name": name, "mimeType": "image/png", "bufferView": self._view(image)},
        )
        texture = self._add("textures", {"source": source, "sampler": 0})
        entry = {
            "name": name,
            "alphaMode": "OPAQUE" if name == "ground" else "BLEND",
            "doubleSided": True,
            # Light is in the texture.
            "pbrMetallicRoughness": {
                "baseColorTexture": {"index": texture},
                "metallicFactor": 0.0,
                "roughnessFactor": 1.0,
            },
            "extensions": {_UNLIT: {}},
        }
        return self._add("materials", entry)
