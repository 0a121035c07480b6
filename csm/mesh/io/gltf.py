"""The glTF 2.0 format, .glb and .gltf: https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html; geometry only.

The reader is csm's own because a glTF file names other files and sizes of memory: neither is taken on trust here.
"""

from __future__ import annotations

import base64
import binascii
import json
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple, TypeAlias
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from csm._counts import counted
from csm._types import FloatArray, IntArray
from csm.errors import MeshError
from csm.mesh.io.choice import Choice, chosen, joined
from csm.mesh.io.raw import RawMesh, strip_triangles, unread

Fetch: TypeAlias = Callable[[str], bytes]
"""Reads a file that lies beside the .gltf file."""

_COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_TRIANGLES, _STRIP, _FAN = 4, 5, 6
_PACKED = ("KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression")


class GltfShape(NamedTuple):
    """Primitives of a mesh with one list of vertices, and where its node puts them."""

    name: str
    positions: int
    primitives: list[dict[str, Any]]
    matrix: FloatArray


def parse_gltf(data: bytes, choose: Choice, fetch: Fetch) -> RawMesh:
    """Read a mesh of a glTF file; materials, skins, animations, points and lines are skipped.

    Vertices are where the scene puts them.  A mesh that is in parts, or a scene of several meshes, has to be chosen
    from; parts that use one list of vertices are one shape.

    Raises
    ------
    MeshError
        If it holds several shapes and none is chosen, is compressed, damaged or cut short, or names files that are not
        beside it.
    """
    document, binary, notes = document_of(data)
    file = GltfFile(document, binary, fetch)
    shapes, skipped = shapes_of(document)
    if skipped:
        notes.append(f"{counted(skipped, 'part of points or lines was', 'parts of points or lines were')} skipped")
    if not shapes:
        raise MeshError("it holds no mesh of triangles")
    picked = chosen([shape.name for shape in shapes], choose)
    mesh = joined([file.mesh(shapes[i]) for i in picked])
    return RawMesh(mesh.vertices, mesh.corners, mesh.sizes, (*notes, *mesh.notes))


def document_of(data: bytes) -> tuple[dict[str, Any], bytes, list[str]]:
    """Return the json, the binary part and notes; MeshError if it is no glTF."""
    notes, binary = [], b""
    if data.startswith(b"glTF"):
        version, length = (int.from_bytes(data[i : i + 4], "little") for i in (4, 8))
        if version != 2:
            raise MeshError(f"it is glTF of version {version}, wanted version 2")
        if length > len(data):
            raise MeshError(f"the head announces {length} bytes, but the file has {len(data)}: it is cut short")
        if length < len(data):
            notes.append(unread(len(data) - length, "byte", "its end"))
        chunks = dict(reversed(list(_chunks(data[:length]))))
        data, binary = chunks.get(b"JSON", b""), chunks.get(b"BIN\0", b"")
    try:
        document = json.loads(data.decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise MeshError(f"its json cannot be read ({str(error)[:100]})") from None
    if not isinstance(document, dict) or "asset" not in document:
        raise MeshError("wanted glTF, which has an 'asset'; this is something else")
    return document, binary, notes


def _chunks(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    at = 12
    while at + 8 <= len(data):
        size = int.from_bytes(data[at : at + 4], "little")
        if size > len(data) - at - 8:
            raise MeshError(f"a part of it announces {size} bytes, but fewer follow: it is cut short")
        yield data[at + 4 : at + 8], data[at + 8 : at + 8 + size]
        at += 8 + size + -size % 4


def item_of(document: dict[str, Any], kind: str, number: Any) -> dict[str, Any]:
    """Return an entry of one of the tables of a file; MeshError if it is not there."""
    table = document.get(kind)
    if isinstance(table, list) and isinstance(number, int) and 0 <= number < len(table):
        found = table[number]
        if isinstance(found, dict):
            return found
    raise MeshError(f"it refers to number {str(number)[:20]} of its {kind}, which is not there")


def shapes_of(document: dict[str, Any]) -> tuple[list[GltfShape], int]:
    """Return the shapes in the order of the scene, and how many primitives are no triangles."""
    shapes: list[GltfShape] = []
    skipped = 0
    for number, matrix in _placed(document):
        mesh = item_of(document, "meshes", number)
        lists: dict[int, list[dict[str, Any]]] = {}
        for primitive in mesh.get("primitives", []):
            if primitive.get("mode", _TRIANGLES) not in (_TRIANGLES, _STRIP, _FAN):
                skipped += 1
            else:
                lists.setdefault(primitive["attributes"]["POSITION"], []).append(primitive)
        name = str(mesh.get("name", f"mesh {number}"))
        for i, (positions, primitives) in enumerate(lists.items()):
            title = f"{name}, part {i}" if len(lists) > 1 else name
            shapes.append(GltfShape(title[:60], positions, primitives, matrix))
    return shapes, skipped


def _placed(document: dict[str, Any]) -> list[tuple[int, FloatArray]]:
    """Return the meshes of the scene and where it puts them, or all meshes if there is no scene."""
    found: list[tuple[int, FloatArray]] = []
    seen: set[int] = set()
    if document.get("scenes"):
        roots = item_of(document, "scenes", document.get("scene", 0)).get("nodes", [])
        waiting = [(node, np.eye(4)) for node in reversed(roots)]
        while waiting:
            number, parent = waiting.pop()
            node = item_of(document, "nodes", number)
            if number in seen:
                raise MeshError(f"its node {number} has two parents: it is damaged")
            seen.add(number)
            matrix = parent @ _matrix(node)
            if "mesh" in node:
                found.append((node["mesh"], matrix))
            waiting += [(child, matrix) for child in reversed(node.get("children", []))]
    return found or [(i, np.eye(4)) for i in range(len(document.get("meshes", [])))]


def _matrix(node: dict[str, Any]) -> FloatArray:
    if "matrix" in node:
        return np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    x, y, z, w = np.array(node.get("rotation", [0, 0, 0, 1]), dtype=np.float64)
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    matrix = np.eye(4)
    matrix[:3, :3] = turn * np.array(node.get("scale", [1, 1, 1]), dtype=np.float64)
    matrix[:3, 3] = node.get("translation", [0, 0, 0])
    return matrix


class GltfFile:
    """Meshes and numbers of a file, of which no size is taken on trust."""

    def __init__(self, document: dict[str, Any], binary: bytes, fetch: Fetch) -> None:
        self.document, self.binary, self.fetch = document, binary, fetch
        self.buffers: dict[int, bytes] = {}

    def mesh(self, shape: GltfShape) -> RawMesh:
        """Return a shape where the scene puts it."""
        for primitive in shape.primitives:
            packed = [name for name in _PACKED if name in primitive.get("extensions", {})]
            if packed:
                raise MeshError(f"{shape.name} is compressed with {packed[0]}; export it without compression")
        points = self.accessor(shape.positions, "VEC3").astype(np.float64)
        faces = np.concatenate([self.faces(primitive, len(points)) for primitive in shape.primitives])
        if np.array_equal(shape.matrix, np.eye(4)):
            return RawMesh.of(points, faces)
        points = points @ shape.matrix[:3, :3].T + shape.matrix[:3, 3]
        if np.linalg.det(shape.matrix[:3, :3]) < 0:
            faces = faces[:, ::-1]
        return RawMesh.of(points, faces, ("the vertices are where the scene of the file puts them",))

    def faces(self, primitive: dict[str, Any], n_vertices: int) -> IntArray:
        """Return the triangles of a primitive, shape (M, 3)."""
        if "indices" in primitive:
            corners = self.accessor(primitive["indices"], "SCALAR").ravel().astype(np.int64)
        else:
            corners = np.arange(n_vertices)
        mode = primitive.get("mode", _TRIANGLES)
        if mode == _STRIP:
            return strip_triangles(corners, np.array([len(corners)]))[0]
        if mode == _FAN:
            rim = corners[1:]
            return np.stack(
                [np.full(max(len(rim) - 1, 0), corners[0] if len(corners) else 0), rim[:-1], rim[1:]], axis=1
            )
        if len(corners) % 3:
            raise MeshError(f"a list of triangles has {len(corners)} corners: it is damaged")
        return corners.reshape(-1, 3)

    def accessor(self, number: int, kind: str) -> NDArray[Any]:
        """Return the rows of an accessor, after checking that its bytes are there."""
        accessor = item_of(self.document, "accessors", number)
        if accessor.get("type") != kind or accessor.get("componentType") not in _COMPONENTS:
            raise MeshError(f"its accessor {number} is no {kind} of a known type of number")
        if "sparse" in accessor or "bufferView" not in accessor:
            raise MeshError(f"its accessor {number} is sparse, which csm does not read")
        view = item_of(self.document, "bufferViews", accessor["bufferView"])
        if any(name in view.get("extensions", {}) for name in _PACKED):
            raise MeshError("it is compressed (meshopt); export it without compression")
        dtype, width, count = np.dtype(_COMPONENTS[accessor["componentType"]]), _WIDTHS[kind], accessor["count"]
        buffer = self.buffer(view["buffer"])
        start, length = view.get("byteOffset", 0), view["byteLength"]
        offset, stride = accessor.get("byteOffset", 0), view.get("byteStride", dtype.itemsize * width)
        numbers = (count, start, length, offset, stride)
        if not all(isinstance(n, int) and n >= 0 for n in numbers) or stride < dtype.itemsize * width:
            raise MeshError(f"its accessor {number} has sizes that make no sense: it is damaged")
        end = offset + stride * (count - 1) + dtype.itemsize * width if count else 0
        if end > length or start + length > len(buffer):
            raise MeshError(f"its accessor {number} announces {count} rows, but its bytes end before: it is cut short")
        rows = np.ndarray((count, width), dtype, buffer, start + offset, (stride, dtype.itemsize))
        if accessor.get("normalized") and dtype.kind != "f":
            return np.maximum(rows / np.iinfo(dtype).max, -1.0)
        return rows

    def buffer(self, number: int) -> bytes:
        """Return the bytes of a buffer."""
        if number not in self.buffers:
            uri = item_of(self.document, "buffers", number).get("uri")
            self.buffers[number] = self.binary if uri is None else self.from_uri(str(uri))
        return self.buffers[number]

    def from_uri(self, uri: str) -> bytes:
        """Return what a uri holds or names; MeshError if it names what is not beside the file."""
        if not uri.startswith("data:"):
            name = unquote(uri)
            if not name or any(part in ("", "..") or ":" in part for part in name.replace("\\", "/").split("/")):
                raise MeshError(
                    f"it names the file {name[:80]!r}; csm reads only files beside it or in folders beside it"
                )
            return self.fetch(name)
        try:
            return base64.b64decode(uri.partition(",")[2], validate=True)
        except binascii.Error:
            raise MeshError("the data inside of its json is damaged") from None
