"""The legacy VTK format, ASCII and binary: https://docs.vtk.org/en/latest/vtk_file_formats/vtk_legacy_file_format.html."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from csm._counts import counted
from csm._types import IntArray
from csm.errors import MeshError
from csm.mesh.io.raw import RawMesh, strip_triangles

_TYPES = {
    "unsigned_char": ">u1",
    "char": ">i1",
    "unsigned_short": ">u2",
    "short": ">i2",
    "unsigned_int": ">u4",
    "int": ">i4",
    "unsigned_long": ">u8",
    "long": ">i8",
    "float": ">f4",
    "double": ">f8",
    "vtkidtype": ">i8",
    "vtktypeint64": ">i8",
    "vtktypeint32": ">i4",
    "vtktypeuint64": ">u8",
    "vtktypeuint32": ">u4",
}
_FLAT, _STRIP, _PIXEL = {5, 7, 9}, 6, 8
_THIN = {0, 1, 2, 3, 4}
"""Cell types: triangles, polygons and quads; strips; pixels; and what has no area: points and lines."""


def parse_vtk(data: bytes) -> RawMesh:
    """Read the points and polygons of a legacy VTK file: POLYDATA, or an UNSTRUCTURED_GRID of flat cells.

    Triangle strips become triangles, behind the polygons; points, lines and all data on them are skipped.

    Raises
    ------
    MeshError
        If it is of another kind (xml, images, volumes), damaged or cut short.
    """
    head = re.match(rb"(?:\xef\xbb\xbf)?\s*#\s*vtk DataFile[^\n]*\n[^\n]*\n\s*(ASCII|BINARY)\s", data, re.IGNORECASE)
    if head is None:
        xml = b"<VTKFile" in data[:400]
        raise MeshError(
            "this is VTK's xml format, which csm does not read; save it as legacy .vtk or as .ply"
            if xml
            else "wanted '# vtk DataFile', a title and 'ASCII' or 'BINARY'; this is no legacy VTK file"
        )
    reader = _Reader(data, head.end(), head[1].upper() == b"BINARY")
    reader.read()
    return reader.mesh()


class _Reader:
    def __init__(self, data: bytes, at: int, binary: bool) -> None:
        self.data, self.at, self.binary = data, at, binary
        self.points: NDArray[np.float64] | None = None
        self.cells: dict[str, tuple[IntArray, IntArray]] = {}
        self.types: NDArray[np.int64] | None = None

    def read(self) -> None:
        kind = ""
        while word := self.word():
            if word == "DATASET":
                kind = self.word()
                if kind not in ("POLYDATA", "UNSTRUCTURED_GRID"):
                    raise MeshError(f"it holds a {kind[:40]}, wanted POLYDATA or an UNSTRUCTURED_GRID of flat cells")
            elif word == "POINTS":
                count, dtype = self.count(), self.word()
                self.points = self.numbers(3 * count, dtype).astype(np.float64).reshape(count, 3)
            elif word in ("POLYGONS", "TRIANGLE_STRIPS", "VERTICES", "LINES", "CELLS"):
                self.cells[word] = self.lists(word)
            elif word == "CELL_TYPES":
                self.types = self.numbers(self.count(), "int").astype(np.int64)
            elif word == "METADATA":
                end = re.compile(rb"\n[ \t\r]*\n").search(self.data, self.at)
                self.at = end.end() if end else len(self.data)
            elif word == "FIELD":
                self.skip_field()
            elif word in ("POINT_DATA", "CELL_DATA"):
                break
            else:
                raise MeshError(f"it has the word {word[:40]!r} where VTK knows none: it is damaged")
        if not kind:
            raise MeshError("it names no DATASET: it is cut short")

    def word(self) -> str:
        found = re.compile(rb"\s*(\S+)").match(self.data, self.at)
        if found is None:
            return ""
        self.at = found.end()
        return found[1][:100].decode("latin-1")

    def count(self) -> int:
        word = self.word()
        if not re.fullmatch(r"\d{1,15}", word, re.ASCII):
            raise MeshError(f"it has {word!r} where a count is wanted")
        return int(word)

    def numbers(self, count: int, kind: str) -> NDArray[np.generic]:
        """Return numbers of a named type, which follow in the next line in binary files."""
        dtype = _TYPES.get(kind.lower())
        if dtype is None:
            raise MeshError(f"it has numbers of the type {kind!r}, which VTK does not know")
        start = self.data.find(b"\n", self.at) + 1 if self.binary else self.at
        size = count * np.dtype(dtype).itemsize if self.binary else 2 * count - 1
        if size > len(self.data) - start:
            raise MeshError(f"it announces {count} numbers, but the file ends before: it is cut short")
        if self.binary:
            self.at = start + size
            return np.frombuffer(self.data, dtype, count, start)
        words = self.data[start:].split(None, count)
        self.at = len(self.data) - (len(words.pop()) if len(words) > count else 0)
        if len(words) < count:
            raise MeshError(f"it announces {count} numbers, but the file ends before: it is cut short")
        try:
            return np.array(words, dtype=np.float64 if dtype[1] == "f" else np.int64)
        except (ValueError, OverflowError):
            raise MeshError(f"among the {count} numbers behind the head of an array is something else") from None

    def lists(self, word: str) -> tuple[IntArray, IntArray]:
        """Return the corners of cells, one cell after the other, and how many each has."""
        first, second = self.count(), self.count()
        before = self.at
        if self.word() == "OFFSETS":  # since version 5.1
            ends = self.numbers(first, self.word()).astype(np.int64)
            if self.word() != "CONNECTIVITY":
                raise MeshError(f"the OFFSETS of {word} are not followed by their CONNECTIVITY")
            corners = self.numbers(second, self.word()).astype(np.int64)
            sizes = np.diff(ends)
            if (len(ends) and (ends[0] != 0 or ends[-1] != len(corners))) or (sizes < 0).any():
                raise MeshError(f"the OFFSETS of {word} do not fit their CONNECTIVITY")
            return corners, sizes
        self.at = before
        table = self.numbers(second, "int").astype(np.int64)
        heads = [0]
        while len(heads) <= first and heads[-1] < len(table) and table[heads[-1]] >= 0:
            heads.append(heads[-1] + 1 + int(table[heads[-1]]))
        if len(heads) != first + 1 or heads[-1] != len(table):
            raise MeshError(f"the {word} announce {first} cells in {second} numbers, which these do not give")
        return np.delete(table, heads[:-1]), table[heads[:-1]]

    def skip_field(self) -> None:
        self.word()
        for _ in range(self.count()):
            self.word()
            width, rows, kind = self.count(), self.count(), self.word()
            if kind == "string":
                for _ in range(width * rows):
                    if not self.word():
                        return
            else:
                self.numbers(width * rows, kind)

    def mesh(self) -> RawMesh:
        if self.points is None:
            raise MeshError("it has no POINTS: it is cut short")
        none = np.zeros(0, dtype=np.int64)
        corners, sizes = self.cells.get("POLYGONS", (none, none))
        strips = self.cells.get("TRIANGLE_STRIPS", (none, none))
        skipped = sum(len(self.cells[key][1]) for key in ("VERTICES", "LINES") if key in self.cells)
        if "CELLS" in self.cells:
            corners, sizes, strips, skipped = self.flat_cells()
        notes = [f"{counted(skipped, 'point or line was', 'points and lines were')} skipped"] if skipped else []
        triangles, left_out = strip_triangles(*strips)
        if len(strips[1]):
            notes.append(
                f"{counted(len(triangles), 'triangle was', 'triangles were')} taken from "
                f"{counted(len(strips[1]), 'triangle strip')}"
            )
            notes[-1] += f"; {left_out} that name a vertex twice were left out" if left_out else ""
        corners = np.concatenate([corners, triangles.ravel()])
        return RawMesh(self.points, corners, np.concatenate([sizes, np.full(len(triangles), 3)]), tuple(notes))

    def flat_cells(self) -> tuple[IntArray, IntArray, tuple[IntArray, IntArray], int]:
        corners, sizes = self.cells["CELLS"]
        if self.types is None or len(self.types) != len(sizes):
            raise MeshError(f"there are {len(sizes)} CELLS, and not as many CELL_TYPES: it is damaged or cut short")
        solid = set(self.types.tolist()) - _FLAT - _THIN - {_STRIP, _PIXEL}
        if solid:
            raise MeshError(f"it holds cells of type {min(solid)}, which are no polygons; csm reads surfaces only")
        pixels = np.flatnonzero(self.types == _PIXEL)
        if (sizes[pixels] != 4).any():
            raise MeshError("it holds a pixel that does not have four corners")
        corners = corners.copy()
        last = (np.cumsum(sizes) - sizes)[pixels] + 2  # the corners of a pixel go row by row, not round
        corners[last], corners[last + 1] = corners[last + 1], corners[last]
        owner = np.repeat(self.types, sizes)
        flat, strip = np.isin(self.types, [*_FLAT, _PIXEL]), self.types == _STRIP
        strips = (corners[owner == _STRIP], sizes[strip])
        return corners[np.isin(owner, [*_FLAT, _PIXEL])], sizes[flat], strips, int((~flat & ~strip).sum())
