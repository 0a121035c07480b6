"""A reader of the numbers in MATLAB files up to v7 that believes no size before it is checked against the bytes.

Written after "MATLAB MAT-File Format", The MathWorks, chapter 1 (level 5 files) and its appendix on level 4 files.
Libraries that read these files trust their sizes, and a damaged file can then end the process or fill the memory.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from csm.errors import MeshError
from csm.mesh.io.guard import LARGEST_UNPACKED, inflate

Value: TypeAlias = "NDArray[Any] | dict[str, Value] | list[Value] | None"
"""An array as MATLAB has it, a struct, a cell or an array of structs, or None for what holds no numbers."""

_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_MATRIX, _COMPRESSED = 14, 15
_CELL, _STRUCT, _OBJECT = 1, 2, 3
_NUMERIC = range(6, 16)
_COMPLEX = 0x08

_DEEPEST = 50
_MOST_ELEMENTS = 250_000


def is_level_4(data: bytes) -> bool:
    """Tell whether the bytes can be a level 4 file: the text of a level 5 header has no zero in its first four."""
    return len(data) >= 20 and 0 in data[:4] and _level_4_header(data, 0) is not None


def is_level_5(data: bytes) -> bool:
    """Tell whether the bytes begin with the header of a level 5 file."""
    return len(data) >= 128 and data[126:128] in (b"IM", b"MI")


def read_level_5(data: bytes) -> dict[str, Value]:
    """Return the variables of a level 5 file (v5, v6, v7) by name.

    Raises
    ------
    MeshError
        If a size is not that of the bytes that are there, or the file is cut short or nested without sense.
    """
    reader = _Level5(data, "<" if data[126:128] == b"IM" else ">")
    return reader.variables()


@dataclass
class _Element:
    """One element: its type and where its bytes lie in a buffer."""

    kind: int
    buffer: memoryview
    end: int
    """Where the next element begins."""


class _Level5:
    def __init__(self, data: bytes, order: str) -> None:
        self.data, self.order = memoryview(data), order
        self.unpacked = 0
        self.elements = 0

    def variables(self) -> dict[str, Value]:
        found: dict[str, Value] = {}
        at = 128
        while at < len(self.data):
            element = self.element(self.data, at)
            at = element.end
            inner = element
            if element.kind == _COMPRESSED:
                content, _ = inflate(bytes(element.buffer), 15, LARGEST_UNPACKED - self.unpacked)
                self.unpacked += len(content)
                inner = self.element(memoryview(content), 0)
            if inner.kind != _MATRIX:
                raise MeshError(f"an element of type {inner.kind} stands where a variable is wanted: it is damaged")
            name, value = self.matrix(inner.buffer, 0)
            if name and not name.startswith("__"):
                found[name] = value
        return found

    def element(self, buffer: memoryview, at: int) -> _Element:
        if at + 8 > len(buffer):
            raise MeshError("the file is cut short")
        self.elements += 1
        if self.elements > _MOST_ELEMENTS:
            raise MeshError(f"it holds more than {_MOST_ELEMENTS} elements, which no mesh has: it is damaged")
        kind, size = struct.unpack_from(f"{self.order}II", buffer, at)
        if kind >> 16:
            kind, size = kind & 0xFFFF, kind >> 16
            if size > 4:
                raise MeshError("an element is longer than the four bytes it has: it is damaged")
            return _Element(kind, buffer[at + 4 : at + 4 + size], at + 8)
        end = at + 8 + size
        if end > len(buffer):
            raise MeshError(f"an element announces {size} bytes, but {len(buffer) - at - 8} follow: it is cut short")
        padded = end if kind == _COMPRESSED else end + -size % 8
        return _Element(kind, buffer[at + 8 : end], min(padded, len(buffer)))

    def numbers(self, element: _Element) -> NDArray[Any]:
        kind = _TYPES.get(element.kind)
        if kind is None:
            raise MeshError(f"an element of type {element.kind} stands where numbers are wanted: it is damaged")
        dtype = np.dtype(f"{self.order}{kind}")
        if len(element.buffer) % dtype.itemsize:
            raise MeshError("an array ends in the middle of a number: it is damaged")
        return np.frombuffer(element.buffer, dtype)

    def matrix(self, buffer: memoryview, depth: int) -> tuple[str, Value]:
        """Read one variable, or a value inside of another, whose name is empty."""
        if depth > _DEEPEST:
            raise MeshError(f"its structs or cells are nested more than {_DEEPEST} times: it is damaged")
        if len(buffer) == 0:
            return "", np.zeros((0, 0))
        flags = self.element(buffer, 0)
        if len(flags.buffer) != 8:
            raise MeshError("the flags of an array are damaged")
        kind, bits = flags.buffer[0 if self.order == "<" else 3], flags.buffer[1 if self.order == "<" else 2]
        if kind not in (_CELL, _STRUCT, _OBJECT, *_NUMERIC) and kind > 15:
            return "", None  # functions and objects of newer kinds have no sizes
        dimensions = self.element(buffer, flags.end)
        shape = tuple(int(n) for n in self.numbers(dimensions))
        if not 2 <= len(shape) <= 32 or min(shape) < 0:
            raise MeshError(f"an array has the shape {shape[:32]}: it is damaged")
        title = self.element(buffer, dimensions.end)
        name = bytes(title.buffer).decode("latin-1")
        if kind in _NUMERIC:
            return name, self.array(buffer, title.end, shape, bool(bits & _COMPLEX))
        if kind == _CELL:
            return name, self.cell(buffer, title.end, math.prod(shape), depth)
        if kind in (_STRUCT, _OBJECT):
            at = self.element(buffer, title.end).end if kind == _OBJECT else title.end
            return name, self.struct(buffer, at, math.prod(shape), depth)
        return name, None

    def array(self, buffer: memoryview, at: int, shape: tuple[int, ...], imaginary: bool) -> NDArray[Any]:
        element = self.element(buffer, at)
        parts = [self.numbers(element)]
        if imaginary:
            parts.append(self.numbers(self.element(buffer, element.end)))
        for part in parts:
            if len(part) != math.prod(shape):
                raise MeshError(f"an array of shape {shape} has {len(part)} numbers: it is damaged")
        if not imaginary:
            return parts[0].reshape(shape, order="F")
        numbers = np.empty(len(parts[0]), dtype=np.complex128)
        numbers.real, numbers.imag = parts
        return numbers.reshape(shape, order="F")

    def cell(self, buffer: memoryview, at: int, count: int, depth: int) -> list[Value]:
        if 8 * count > len(buffer) - at:
            raise MeshError(f"a cell announces {count} values, for which it is too short: it is damaged")
        values: list[Value] = []
        for _ in range(count):
            element = self.element(buffer, at)
            if element.kind != _MATRIX:
                raise MeshError(f"an element of type {element.kind} stands where a value is wanted: it is damaged")
            values.append(self.matrix(element.buffer, depth + 1)[1])
            at = element.end
        return values

    def struct(self, buffer: memoryview, at: int, count: int, depth: int) -> Value:
        width = self.element(buffer, at)
        lengths = self.numbers(width)
        table = self.element(buffer, width.end)
        length = int(lengths[0]) if len(lengths) == 1 else 0
        if length < 1 or len(table.buffer) % length:
            raise MeshError("the field names of a struct are damaged")
        text = bytes(table.buffer)
        cut = (text[i : i + length].partition(b"\0")[0] for i in range(0, len(text), length))
        names = [name.decode("latin-1") for name in cut]
        if not names:
            return {}
        values = self.cell(buffer, table.end, count * len(names), depth)
        structs: list[Value] = [
            dict(zip(names, values[i : i + len(names)], strict=True)) for i in range(0, len(values), len(names))
        ]
        return structs[0] if count == 1 else structs


_LEVEL_4_TYPES = ("f8", "f4", "i4", "i2", "u2", "u1")


def _level_4_header(data: bytes, at: int) -> tuple[str, int, int, int, int, bool] | None:
    """Return type of number, kind of matrix, rows, columns, length of the name, whether complex; None if it is none."""
    for order in "<>":
        code, rows, columns, imaginary, length = struct.unpack_from(f"{order}iiiii", data, at)
        thousands, rest = divmod(code, 1000)
        number, kind = rest // 10 % 10, rest % 10
        sound = thousands == (0 if order == "<" else 1) and rest < 100 and number < 6 and kind < 3
        if code >= 0 and sound and rows >= 0 and columns >= 0 and imaginary in (0, 1) and 0 < length < 1024:
            return order + _LEVEL_4_TYPES[number], kind, rows, columns, length, bool(imaginary)
    return None


def read_level_4(data: bytes) -> dict[str, Value]:
    """Return the matrices of a level 4 file by name; text and sparse matrices are None.

    Raises
    ------
    MeshError
        If a size is not that of the bytes that are there.
    """
    found: dict[str, Value] = {}
    at = 0
    while at < len(data):
        header = _level_4_header(data, at) if at + 20 <= len(data) else None
        if header is None:
            raise MeshError("a matrix has a header that makes no sense: it is damaged or cut short")
        kind, matrix, rows, columns, length, imaginary = header
        count, dtype = rows * columns * (1 + imaginary), np.dtype(kind)
        name = data[at + 20 : at + 20 + length].partition(b"\0")[0].decode("latin-1")
        at += 20 + length
        if count * dtype.itemsize > len(data) - at:
            raise MeshError(f"{name} announces {rows} x {columns} numbers, but the file is shorter: it is cut short")
        numbers = np.frombuffer(data, dtype, count, at)
        at += count * dtype.itemsize
        if imaginary:
            pair = np.empty(rows * columns, dtype=np.complex128)
            pair.real, pair.imag = numbers[: rows * columns], numbers[rows * columns :]
            numbers = pair
        found[name] = numbers.reshape(rows, columns, order="F") if matrix == 0 else None
    return found
