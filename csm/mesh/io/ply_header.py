"""The header of a PLY file: which elements it announces, with which properties."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from csm.errors import MeshError

_TYPES = {
    "char": "i1",
    "uchar": "u1",
    "short": "i2",
    "ushort": "u2",
    "int": "i4",
    "uint": "u4",
    "int8": "i1",
    "uint8": "u1",
    "int16": "i2",
    "uint16": "u2",
    "int32": "i4",
    "uint32": "u4",
    "int64": "i8",
    "uint64": "u8",
    "float": "f4",
    "double": "f8",
    "float32": "f4",
    "float64": "f8",
}
_FORMATS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


@dataclass(frozen=True)
class Property:
    """A number, or a list of numbers if `length` names the type of their count."""

    name: str
    kind: str
    length: str = ""


@dataclass
class Element:
    """A table of the file: its name, its number of rows and its columns."""

    name: str
    count: int
    properties: list[Property] = field(default_factory=list)


@dataclass(frozen=True)
class Header:
    """What the header says; `order` is empty for ASCII, and the elements begin at byte `start`."""

    order: str
    elements: list[Element]
    start: int


def read_header(data: bytes) -> Header:
    """Read the header, from the line `ply` to the line `end_header`.

    Raises
    ------
    MeshError
        If it has no such ends or a line that PLY does not know.
    """
    order: str | None = None
    elements: list[Element] = []
    for line, end in _header_lines(data):
        words = line.split()
        if words == ["end_header"]:
            if order is None:
                raise MeshError("the PLY header names no format")
            return Header(order, elements, end)
        if not words or words[0].lower() in ("comment", "obj_info", "ply"):
            continue
        if words[0] == "format" and len(words) > 1 and words[1] in _FORMATS:
            order = _FORMATS[words[1]]
        elif words[0] == "element" and len(words) == 3 and re.fullmatch(r"\d{1,18}", words[2], re.ASCII):
            elements.append(Element(words[1], int(words[2])))
        elif words[0] == "property" and elements and (found := _property(words)):
            elements[-1].properties.append(found)
        else:
            raise MeshError(f"the PLY header has the line {line.strip()[:80]!r}, which makes no sense there")
    raise MeshError("wanted a PLY header from 'ply' to 'end_header'; this is another format or a damaged file")


def _header_lines(data: bytes) -> Iterator[tuple[str, int]]:
    """Yield the lines of the header and where each ends; lines may end in any of the three ways."""
    if not re.match(rb"(?i:ply)\s*?[\r\n]", data[:80]):
        return
    separator = b"\r" if re.match(rb"(?i:ply)[ \t]*\r(?!\n)", data[:80]) else b"\n"
    at = 0
    while (end := data.find(separator, at)) >= 0:
        yield data[at:end].decode("latin-1"), end + 1
        at = end + 1
    if data[at:].strip() == b"end_header":  # of a file without anything in it
        yield "end_header", len(data)


def _property(words: Sequence[str]) -> Property | None:
    if len(words) == 3 and words[1] in _TYPES:
        return Property(words[2], _TYPES[words[1]])
    if len(words) == 5 and words[1] == "list" and words[3] in _TYPES and _TYPES.get(words[2], "f")[0] != "f":
        return Property(words[4], _TYPES[words[3]], _TYPES[words[2]])
    return None
