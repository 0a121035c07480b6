"""The STL format, ASCII and binary: separate triangles that share no vertices."""

from __future__ import annotations

import numpy as np

from csm._types import FloatArray
from csm.errors import MeshError
from csm.mesh.io.raw import RawMesh, coordinates, decode, unread

_HEAD = 84
_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def parse_stl(data: bytes) -> RawMesh:
    """Read an STL file, ASCII or binary, as it is: three vertices of its own for each of the M triangles, N = 3 M.

    Nothing is merged, so the surface is not connected and `csm check` reports duplicate vertices and M components.
    Several solids are joined in the file's order.

    Raises
    ------
    MeshError
        If there is no triangle or the file is damaged or cut short.
    """
    if _is_ascii(data):
        return _parse_ascii(data)
    if len(data) < _HEAD:
        raise MeshError("wanted 'solid' or a binary head of 84 bytes: this is no STL file, or it is cut short")
    return _parse_binary(data)


def _is_ascii(data: bytes) -> bool:
    """Tell the kinds apart: some programs begin a binary file with `solid`, too, but its length gives it away."""
    if len(data) >= _HEAD and len(data) == _HEAD + _FACET.itemsize * _announced(data):
        return False
    start = data[:512].removeprefix(b"\xef\xbb\xbf").lstrip().lower()
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        start = decode(data[:512]).lstrip().lower().encode("latin-1", "replace")
    elif b"\0" in data[:4096]:
        return False
    return start.startswith((b"solid", b"facet"))


def _announced(data: bytes) -> int:
    return int.from_bytes(data[80:84], "little")


def _parse_binary(data: bytes) -> RawMesh:
    announced, body = _announced(data), len(data) - _HEAD
    whole, rest = divmod(body, _FACET.itemsize)
    notes: tuple[str, ...] = ()
    count = announced
    if announced > whole:
        raise MeshError(f"the head announces {announced} triangles, but only {whole} are there: the file is cut short")
    left = body - announced * _FACET.itemsize
    if left and not rest and any(data[-left:]):
        count = whole
        notes = (f"the head announces {announced} triangles, but {whole} are there; all of them were read",)
    elif left:
        notes = (unread(left, "byte", "the last triangle"),)
    if count == 0:
        raise MeshError("it holds no triangle: an empty or damaged STL file")
    facets = np.frombuffer(data, _FACET, count, _HEAD)
    return _soup(facets["corners"].reshape(-1, 3).astype(np.float64), notes)


def _soup(corners: FloatArray, notes: tuple[str, ...]) -> RawMesh:
    return RawMesh.of(corners, np.arange(len(corners)).reshape(-1, 3), notes)


def _parse_ascii(data: bytes) -> RawMesh:
    points: list[list[str]] = []
    solids = ends = 0
    first = 0  # vertices before the facet that is being read
    for line in decode(data).splitlines():
        words = line.split()
        key = words[0].lower() if words else ""
        if key == "vertex":
            points.append(words[1:])
        elif key in ("facet", "endfacet", "endloop", "solid", "endsolid"):
            if len(points) not in (first, first + 3):
                raise MeshError(f"triangle {first // 3} has {len(points) - first} corners; the file is damaged")
            first = len(points)
            solids += key == "solid"
            ends += key == "endsolid"
    if len(points) % 3:
        raise MeshError(f"the file ends in the middle of triangle {first // 3}: it was cut short")
    if not points:
        raise MeshError("it holds no triangle: an empty or damaged STL file")
    notes = [f"it holds {solids} solids; they were joined in the file's order"] if solids > 1 else []
    if ends < max(solids, 1):
        notes.append("its last solid has no end ('endsolid'); the file may have been cut short")
    return _soup(coordinates(points), tuple(notes))
