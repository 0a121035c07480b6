"""What a mesh file says of its vertices besides where they are: colours, and the names of the rest."""

from __future__ import annotations

import codecs
import os
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from csm.mesh.io.files import read_bytes
from csm.mesh.io.guard import inflate, most_unpacked, parsing
from csm.mesh.io.ply_header import read_header
from csm.mesh.io.ply_rows import read_elements
from csm.mesh.io.raw import decode

_RGB = ("red", "green", "blue")


@dataclass(frozen=True, eq=False)
class Extras:
    """What a file has besides the places of vertices.

    Parameters
    ----------
    colors
        Shape (N, 3), uint8 red, green, blue per vertex; None if there are none, or of another kind.
    others
        Names of what else the file says of its vertices, in its words where it has some.
    """

    colors: NDArray[np.uint8] | None = None
    others: tuple[str, ...] = ()


def read_extras(path: str | os.PathLike[str]) -> Extras:
    """Return what a .ply, .obj or .off file, also as .gz, says of its vertices; nothing of files of other formats.

    Colours are those of a .ply, of one byte each, and those behind the coordinates of an .obj, from 0 to 1.

    Raises
    ------
    MeshError
        If the file is damaged.
    """
    given = os.fspath(path)
    packed = given.lower().endswith(".gz")
    suffix = Path(given[:-3] if packed else given).suffix.lower()
    parse = {".ply": _of_ply, ".obj": _of_obj, ".off": _of_off}.get(suffix)
    if parse is None:
        return Extras()
    data = read_bytes(given)
    with parsing(given, suffix):
        return parse(inflate(data, limit=most_unpacked(len(data)))[0] if packed else data)


def _of_ply(data: bytes) -> Extras:
    data = data.removeprefix(codecs.BOM_UTF8)
    header = read_header(data)
    kinds = {p.name: p.length or p.kind for e in header.elements if e.name == "vertex" for p in e.properties}
    others = [name for name in kinds if name not in ("x", "y", "z")]
    if any(kinds.get(name) != "u1" for name in _RGB):
        return Extras(others=tuple(others))
    columns = read_elements(data, header, ("vertex",))[0]["vertex"]
    if any((columns[name].sizes != 1).any() for name in _RGB):
        return Extras(others=tuple(others))
    values = np.stack([columns[name].values for name in _RGB], axis=1)
    if not np.isin(values, np.arange(256)).all():  # numbers of a text file may be any
        return Extras(others=tuple(others))
    return Extras(values.astype(np.uint8), tuple(name for name in others if name not in _RGB))


def _of_obj(data: bytes) -> Extras:
    text = re.sub(r"\\(\r\n|\n|\r)", " ", decode(data))
    rows = [words for line in text.splitlines() if (words := line.partition("#")[0].split())]
    heads = {row[0] for row in rows}
    others = [name for head, name in (("vt", "texture coordinates"), ("vn", "normals")) if head in heads]
    widths = {len(row) for row in rows if row[0] == "v"}
    colors = None
    if widths == {7}:
        colors = _of_unit([row[4:] for row in rows if row[0] == "v"])
    if colors is None and widths & {7, 8}:
        others = ["colours", *others]
    return Extras(colors, tuple(others))


def _of_unit(words: list[list[str]]) -> NDArray[np.uint8] | None:
    """Return colours that are written as numbers from 0 to 1; None if they are anything else."""
    try:
        values = np.array(words, dtype=np.float64)
    except ValueError:
        return None
    return np.rint(255 * values).astype(np.uint8) if ((values >= 0) & (values <= 1)).all() else None


def _of_off(data: bytes) -> Extras:
    found = re.match(r"\s*(?P<texture>ST)?(?P<colour>C)?(?P<normal>N)?OFF", decode(data[:256]))
    names = {"texture": "texture coordinates", "colour": "colours", "normal": "normals"}
    return Extras(others=tuple(name for key, name in names.items() if found and found[key]))
