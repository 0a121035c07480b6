"""Point maps, lists of names and lists of pairs."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from csm._types import IntArray
from csm.errors import DataError, MeshError
from csm.mesh.correspondence import Direction, PointMap
from csm.mesh.io.files import atomic_path, read_bytes
from csm.mesh.io.guard import parsing
from csm.mesh.io.matlab import label_vector
from csm.mesh.io.raw import is_number

_SIDES = {
    Direction.TEMPLATE_TO_SHAPE: ("template point", "vertex of the shape"),
    Direction.SHAPE_TO_TEMPLATE: ("vertex of the shape", "template point"),
}


def read_vts(path: str | os.PathLike[str], n_vertices: int) -> PointMap:
    """Read a `.vts` file: line i holds the vertex of the shape, counted from 1, that is template point i.

    The file therefore has as many lines as the template has points, not as the shape has vertices.

    Parameters
    ----------
    path
        The file.
    n_vertices
        Number of vertices of the shape that the file belongs to.

    Raises
    ------
    DataError
        If the file is missing, is not a list of whole numbers, or names a vertex outside of 1..n_vertices that is not
        -1, which stands for a template point that the shape does not have.
    """
    return read_labels(path, direction=Direction.TEMPLATE_TO_SHAPE, base=1, n_to=n_vertices)


def read_labels(path: str | os.PathLike[str], *, direction: Direction, base: int, n_to: int) -> PointMap:
    """Read a point map from a text file with one number per line or from the vector `labels` of a .mat file.

    Parameters
    ----------
    path
        The file; every suffix but .mat is text, in which `#` starts a comment.
    direction
        Which way the map goes.
    base
        The number that the file gives to the first point of the "to" side: 0 or 1.
    n_to
        Number of points on the "to" side: vertices of the shape for template -> shape, template points otherwise.

    Returns
    -------
    PointMap
        0-based; entries of -1 in the file stay "no counterpart".

    Raises
    ------
    DataError
        If the file is missing, is not a list of whole numbers, or has numbers outside of base..n_to-1+base.
    """
    numbers = _numbers(path)
    bad = np.flatnonzero(((numbers < base) & (numbers != -1)) | (numbers >= n_to + base))
    if bad.size:
        here, there = _SIDES[direction]
        raise DataError(
            f"{path}: entry {bad[0] + 1} is {numbers[bad[0]]}, wanted {base}..{n_to - 1 + base}. The file is read as "
            f"{direction.value}, counted from {base}: entry i is the {there} for {here} i; it has {len(numbers)} "
            f"entries and there are {n_to} on the right side. Is it of another shape, or the other way round?"
        )
    return PointMap(np.where(numbers == -1, -1, numbers - base), direction, n_to, str(path))


def _numbers(path: str | os.PathLike[str]) -> IntArray:
    values = _mat_numbers(path) if Path(path).suffix.lower() == ".mat" else _text_numbers(path)
    if values.size == 0:
        raise DataError(f"{path}: the file holds no numbers")
    whole = (np.abs(values) < 2.0**53) & (values == np.round(values))
    if not whole.all():
        first = int(np.flatnonzero(~whole)[0])
        raise DataError(f"{path}: entry {first + 1} is {values[first]}, wanted a whole number")
    return values.astype(np.int64)


def _mat_numbers(path: str | os.PathLike[str]) -> NDArray[Any]:
    data = read_bytes(path)
    try:
        with parsing(os.fspath(path), ".mat"):
            return label_vector(data)
    except MeshError as error:
        raise DataError(str(error)) from error.__cause__


def _text_numbers(path: str | os.PathLike[str]) -> NDArray[Any]:
    lines = _lines(path)
    words = lines[0].split() if len(lines) == 1 else lines
    try:
        return np.array(words, dtype=np.float64)
    except ValueError:
        first = next(i for i, word in enumerate(words) if not is_number(word))
        raise DataError(f"{path}: entry {first + 1} is {words[first][:80]!r}, wanted one number per line") from None


def _lines(path: str | os.PathLike[str]) -> list[str]:
    """Return the lines of a text file that are more than a comment, without comments and surrounding blanks."""
    text = read_bytes(path).decode("utf-8-sig", errors="replace")
    if "#" in text:
        text = re.sub(r"#[^\r\n]*", "", text)
    return [line for raw in text.splitlines() if (line := raw.strip())]


def read_names(path: str | os.PathLike[str]) -> list[str]:
    """Read a list of shape names, one per line, as the files of a split have them."""
    return _lines(path)


def read_pairs(path: str | os.PathLike[str]) -> list[tuple[str, str]]:
    """Read a list of pairs of shape names: two per line, separated by blanks, tabs or a comma.

    Raises
    ------
    DataError
        If the file is missing or a line does not hold two names.
    """
    pairs = []
    for i, line in enumerate(_lines(path)):
        names = line.replace(",", " ").split()
        if len(names) != 2:
            raise DataError(f"{path}: entry {i + 1} is {line[:80]!r}, wanted two names")
        pairs.append((names[0], names[1]))
    return pairs


def write_map(path: str | os.PathLike[str], indices: IntArray, *, meaning: str = "") -> None:
    """Write a map of vertex numbers atomically; the suffix chooses the form.

    Parameters
    ----------
    path
        `.txt`: 0-based, one number per line under the comment `meaning`; `.npz`: arrays `indices` (0-based) and
        `meaning`; `.vts`: 1-based without comments, as that format has it.
    indices
        Shape (n_from,): 0-based numbers on the "to" side, -1 for none (not possible in a .vts file).
    meaning
        One line that says which way the map goes.

    Raises
    ------
    DataError
        If the suffix is none of these, or a .vts file would have to say "none".
    """
    path = Path(path)
    values = np.asarray(indices, dtype=np.int64)
    if path.suffix not in (".txt", ".npz", ".vts"):
        raise DataError(f"{path}: maps are written as .txt, .npz or .vts")
    if path.suffix == ".vts" and (values < 0).any():
        raise DataError(f"{path}: point {np.flatnonzero(values < 0)[0]} has no counterpart, which .vts cannot say")
    with atomic_path(path) as temporary:
        if path.suffix == ".npz":
            np.savez(temporary, indices=values, meaning=np.array(meaning))
        else:
            head = [f"# {' '.join(meaning.split())}; 0-based, -1 for none"] if path.suffix == ".txt" else []
            base = 1 if path.suffix == ".vts" else 0
            temporary.write_text("\n".join([*head, *map(str, (values + base).tolist())]) + "\n", encoding="utf-8")
