"""Texture coordinates and images of glTF 2.0 files, and writing of a textured mesh as .glb."""

from __future__ import annotations

import json
import struct
from pathlib import PurePosixPath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from csm._types import FloatArray
from csm.errors import MeshError
from csm.mesh.io.choice import Choice, chosen
from csm.mesh.io.gltf import Fetch, GltfFile, document_of, item_of, shapes_of
from csm.mesh.textured import Image, Textured

_MIME = {".png": "image/png", ".jpg": "image/jpeg", ".jpeg": "image/jpeg", ".webp": "image/webp"}
_SUFFIXES = {"image/png": ".png", "image/jpeg": ".jpg", "image/webp": ".webp"}
_FLOAT, _UNSIGNED, _ARRAY, _ELEMENTS = 5126, 5125, 34962, 34963


def parse_gltf_texture(
    data: bytes, choose: Choice, fetch: Fetch
) -> tuple[FloatArray, tuple[Image, ...], NDArray[np.int64], tuple[str, ...]]:
    """Return coordinates, (M, 3, 2), images, the image of each face, (M,), and notes; faces as `parse_gltf` has them.

    Raises
    ------
    MeshError
        As `csm.mesh.io.gltf.parse_gltf`.
    """
    document, binary, _ = document_of(data)
    file = GltfFile(document, binary, fetch)
    images: dict[int, Image] = {}
    notes: list[str] = []
    uv, image_of = [], []
    shapes = shapes_of(document)[0]
    for i in chosen([shape.name for shape in shapes], choose):
        n = len(file.accessor(shapes[i].positions, "VEC3"))
        mirrored = np.linalg.det(shapes[i].matrix[:3, :3]) < 0
        for primitive in shapes[i].primitives:
            faces = file.faces(primitive, n)
            number, coordinates = _material(document, primitive, notes)
            attribute = primitive["attributes"].get(f"TEXCOORD_{coordinates}")
            if attribute is None:
                uv.append(np.full((len(faces), 3, 2), np.nan))
                number = -1
            else:
                places = file.accessor(attribute, "VEC2").astype(np.float64) * [1, -1] + [0, 1]
                uv.append(places[faces[:, ::-1] if mirrored else faces])
            if number >= 0 and number not in images:
                images[number] = _image(file, number)
            image_of.append(np.full(len(faces), list(images).index(number) if number >= 0 else -1))
    return np.concatenate(uv), tuple(images.values()), np.concatenate(image_of), tuple(dict.fromkeys(notes))


def _material(document: dict[str, Any], primitive: dict[str, Any], notes: list[str]) -> tuple[int, int]:
    """Return the number of the image of a primitive, -1 for none, and which of its texture coordinates it uses."""
    if "material" not in primitive:
        return -1, 0
    surface = item_of(document, "materials", primitive["material"]).get("pbrMetallicRoughness", {})
    used = surface.get("baseColorTexture")
    if used is None:
        return -1, 0
    if "KHR_texture_transform" in used.get("extensions", {}):
        notes.append("the file moves its texture coordinates (KHR_texture_transform), which was not done here")
    return item_of(document, "textures", used["index"]).get("source", -1), used.get("texCoord", 0)


def _image(file: GltfFile, number: int) -> Image:
    image = item_of(file.document, "images", number)
    if "bufferView" in image:
        view = item_of(file.document, "bufferViews", image["bufferView"])
        start, length = view.get("byteOffset", 0), view["byteLength"]
        data = file.buffer(view["buffer"])[start : start + length]
        if len(data) < length:
            raise MeshError(f"its image {number} announces {length} bytes, but {len(data)} are there: it is cut short")
        return Image(_SUFFIXES.get(str(image.get("mimeType")), ".png"), data)
    uri = str(image.get("uri", ""))
    if uri.startswith("data:"):
        return Image(_SUFFIXES.get(uri[5:].partition(";")[0], ".png"), file.from_uri(uri))
    return Image(PurePosixPath(uri).suffix.lower() or ".png", file.from_uri(uri))


def format_glb(texture: Textured) -> bytes:
    """Write a textured mesh as .glb, which has numbers of 32 bits and one place in the image per vertex.

    So vertices on a seam are written once for each of their places.
    """
    places = np.nan_to_num(texture.uv, nan=0.0)
    rows = np.column_stack([texture.mesh.faces.ravel(), places.reshape(-1, 2)])
    kept, which = np.unique(rows, axis=0, return_inverse=True)
    faces, numbers = which.reshape(-1, 3), texture.image_numbers
    positions = texture.mesh.vertices[kept[:, 0].astype(np.int64)].astype("<f4")
    file = _Glb()
    attributes = {
        "POSITION": file.rows(positions, "VEC3", _ARRAY, min=positions.min(0).tolist(), max=positions.max(0).tolist()),
        "TEXCOORD_0": file.rows((kept[:, 1:] * [1, -1] + [0, 1]).astype("<f4"), "VEC2", _ARRAY),
    }
    primitives = []
    for number in np.unique(numbers).tolist():
        indices = file.rows(faces[numbers == number].astype("<u4").reshape(-1, 1), "SCALAR", _ELEMENTS)
        primitives.append({"attributes": attributes, "indices": indices, "material": number + 1})
    return file.finished(texture.mesh.name, primitives, texture.images)


class _Glb:
    def __init__(self) -> None:
        self.binary = b""
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def view(self, data: bytes, **more: Any) -> int:
        self.binary += b"\0" * (-len(self.binary) % 4)
        self.views.append({"buffer": 0, "byteOffset": len(self.binary), "byteLength": len(data), **more})
        self.binary += data
        return len(self.views) - 1

    def rows(self, array: NDArray[Any], kind: str, target: int, **more: Any) -> int:
        number = _FLOAT if array.dtype.kind == "f" else _UNSIGNED
        view = self.view(array.tobytes(), target=target)
        accessor = {"bufferView": view, "componentType": number, "count": len(array), "type": kind, **more}
        self.accessors.append(accessor)
        return len(self.accessors) - 1

    def finished(self, name: str, primitives: list[dict[str, Any]], images: tuple[Image, ...]) -> bytes:
        pictures = [
            {"bufferView": self.view(image.data), "mimeType": _MIME.get(image.suffix, "image/png")} for image in images
        ]
        surfaces: list[dict[str, Any]] = [{}, *({"baseColorTexture": {"index": i}} for i in range(len(images)))]
        document: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "csm"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0, "name": name}],
            "meshes": [{"name": name, "primitives": primitives}],
            "materials": [
                {"pbrMetallicRoughness": {**surface, "metallicFactor": 0.0}, "doubleSided": True}
                for surface in surfaces
            ],
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [{"byteLength": len(self.binary)}],
        }
        if images:
            document |= {"images": pictures, "textures": [{"source": i} for i in range(len(images))]}
        text = json.dumps(document, separators=(",", ":")).encode("ascii")
        text += b" " * (-len(text) % 4)
        binary = self.binary + b"\0" * (-len(self.binary) % 4)
        head = struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(binary))
        return b"".join(
            [head, struct.pack("<I4s", len(text), b"JSON"), text, struct.pack("<I4s", len(binary), b"BIN\0"), binary]
        )
