"""The elements of a PLY file and their properties, in ASCII and in binary of both byte orders."""

from __future__ import annotations

import re
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from csm._types import IntArray
from csm.errors import MeshError
from csm.mesh.io.ply_header import Element, Header, Property
from csm.mesh.io.raw import is_number, unread


@dataclass(frozen=True)
class Column:
    """The values of one property, one row after the other, and how many each row has."""

    values: NDArray[Any]
    sizes: IntArray


def read_elements(data: bytes, header: Header, wanted: Sequence[str]) -> tuple[dict[str, dict[str, Column]], str]:
    """Return the columns of the wanted elements, by element and property, and a note on what follows the last element.

    Raises
    ------
    MeshError
        If an element is cut short or a row does not have the numbers that the header announces.
    """
    tables: dict[str, dict[str, Column]] = {}
    if not header.order:
        text = data[header.start :]
        if b"\0" in text:
            raise MeshError("this is a binary or damaged file, wanted text")
        rows = [words for line in text.decode("latin-1").splitlines() if (words := line.split())]
        for element in header.elements:
            used = element.count if element.properties else 0
            if used > len(rows):
                raise _cut(element, len(rows))
            if element.name in wanted:
                tables[element.name] = _ascii_columns(element, rows[:used])
            rows = rows[used:]
        return tables, unread(len(rows), "line", "the last element") if rows else ""
    at = header.start
    for element in header.elements:
        columns, at = _binary_columns(element, data, at, header.order)
        if element.name in wanted:
            tables[element.name] = columns
    left = len(data) - at
    return tables, unread(left, "byte", "the last element") if left else ""


def _ascii_columns(element: Element, rows: list[list[str]]) -> dict[str, Column]:
    properties = element.properties
    sizes = [np.ones(len(rows), dtype=np.int64) for _ in properties]
    lists = [i for i, p in enumerate(properties) if p.length]
    width = _equal_width(rows, properties)
    for row_number, row in enumerate(rows if width is None else ()):
        at = 0
        for i, p in enumerate(properties):
            if p.length:
                word = row[at] if at < len(row) else ""
                if not re.fullmatch(r"\d{1,9}", word, re.ASCII):
                    raise _odd_row(element, row_number, row)
                sizes[i][row_number] = int(word)
                at += int(word)
            at += 1
        if at != len(row):
            raise _odd_row(element, row_number, row)
    if width is not None and lists:
        sizes[lists[0]][:] = width
    try:
        flat = np.array([word for row in rows for word in row], dtype=np.float64)
    except ValueError:
        bad = next(i for i, row in enumerate(rows) if not all(map(is_number, row)))
        raise _odd_row(element, bad, rows[bad]) from None
    words = np.array([size + bool(p.length) for size, p in zip(sizes, properties, strict=True)], dtype=np.int64)
    ends = np.cumsum(words.T.ravel()).reshape(len(rows), len(properties))
    return {
        p.name: Column(flat[_positions(ends[:, i] - sizes[i], sizes[i], 1)], sizes[i]) for i, p in enumerate(properties)
    }


def _equal_width(rows: list[list[str]], properties: Sequence[Property]) -> int | None:
    """Return the length of the only list if it is the same in all rows, 0 without a list, None if there is doubt."""
    lists = [i for i, p in enumerate(properties) if p.length]
    if len(lists) > 1 or not rows:
        return None
    if not lists:
        return 0 if all(len(row) == len(properties) for row in rows) else None
    at, word = lists[0], rows[0][lists[0]] if len(rows[0]) > lists[0] else ""
    if not re.fullmatch(r"\d{1,9}", word, re.ASCII):
        return None
    total = len(properties) + int(word)
    return int(word) if all(len(row) == total and row[at] == word for row in rows) else None


def _odd_row(element: Element, number: int, row: Sequence[str]) -> MeshError:
    names = " ".join(f"(list) {p.name}" if p.length else p.name for p in element.properties)
    return MeshError(f"{element.name} {number} is {' '.join(row)[:80]!r}, wanted the numbers {names}")


def _positions(starts: IntArray, sizes: IntArray, step: int) -> IntArray:
    """Return where the values of runs lie that begin at `starts` and have `sizes` values, `step` apart."""
    within = np.arange(int(sizes.sum())) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    positions: IntArray = np.repeat(starts, sizes) + step * within
    return positions


def _binary_columns(element: Element, data: bytes, at: int, order: str) -> tuple[dict[str, Column], int]:
    if not element.properties or not element.count:
        nothing = np.zeros(0, dtype=np.int64)
        return {p.name: Column(nothing, nothing) for p in element.properties}, at
    return _equal_rows(element, data, at, order) or _unequal_rows(element, data, at, order)


def _equal_rows(element: Element, data: bytes, at: int, order: str) -> tuple[dict[str, Column], int] | None:
    """Read rows of the same length in one go; None if their lists differ or they do not fit."""
    fields: list[tuple[Any, ...]] = []
    lengths: list[int] = []
    for i, p in enumerate(element.properties):
        if not p.length:
            fields.append((f"v{i}", order + p.kind))
            lengths.append(1)
            continue
        head = np.dtype(order + p.length)
        behind = at + np.dtype(fields).itemsize if fields else at
        if behind + head.itemsize > len(data):
            return None
        lengths.append(int(np.frombuffer(data, head, 1, behind)[0]))
        if not 0 <= lengths[-1] <= len(data):
            return None
        fields += [(f"n{i}", head), (f"v{i}", order + p.kind, (lengths[-1],))]
    row = np.dtype(fields)
    if element.count * row.itemsize > len(data) - at:
        return None
    table = np.frombuffer(data, row, element.count, at)
    if any((table[f"n{i}"] != n).any() for i, n in enumerate(lengths) if element.properties[i].length):
        return None
    columns = {
        p.name: Column(table[f"v{i}"].reshape(-1), np.full(element.count, lengths[i], dtype=np.int64))
        for i, p in enumerate(element.properties)
    }
    return columns, at + element.count * row.itemsize


def _unequal_rows(element: Element, data: bytes, at: int, order: str) -> tuple[dict[str, Column], int]:
    """Walk from row to row, since the length of each is known only from its lists, then gather the columns."""
    plan = [
        (np.dtype(order + p.kind).itemsize, struct.Struct(order + np.dtype(p.length).char) if p.length else None)
        for p in element.properties
    ]
    starts: list[list[int]] = [[] for _ in plan]
    sizes: list[list[int]] = [[] for _ in plan]
    for row in range(element.count):
        for i, (width, head) in enumerate(plan):
            size = 1
            if head is not None:
                if at + head.size > len(data):
                    raise _cut(element, row)
                (size,) = head.unpack_from(data, at)
                at += head.size
                if size < 0:
                    raise MeshError(f"{element.name} {row} has a list of {size} numbers: the file is damaged")
                sizes[i].append(size)
            starts[i].append(at)
            at += size * width
        if at > len(data):
            raise _cut(element, row)
    whole = np.frombuffer(data, np.uint8)
    columns = {}
    for i, p in enumerate(element.properties):
        dtype = np.dtype(order + p.kind)
        counts = np.array(sizes[i], dtype=np.int64) if p.length else np.ones(element.count, dtype=np.int64)
        where = _positions(np.array(starts[i], dtype=np.int64), counts, dtype.itemsize)
        values = whole[where[:, None] + np.arange(dtype.itemsize)].reshape(-1).view(dtype)
        columns[p.name] = Column(values, counts)
    return columns, at


def _cut(element: Element, found: int) -> MeshError:
    return MeshError(
        f"the header announces {element.count} of the element '{element.name}', but only {found} could be read: "
        "the file is cut short"
    )
