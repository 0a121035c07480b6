"""`read_mesh`, `read_polygons` and `write_mesh` for all mesh formats."""

from __future__ import annotations

import difflib
import os
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from csm.errors import ConfigError, DataError, MeshError
from csm.mesh.io.choice import Choice
from csm.mesh.io.files import atomic_path, read_bytes, read_bytes_of_head
from csm.mesh.io.gltf import Fetch, parse_gltf
from csm.mesh.io.guard import inflate, most_unpacked, parsing, require_path_and
from csm.mesh.io.matlab import parse_mat
from csm.mesh.io.npz import parse_npz
from csm.mesh.io.obj import format_obj, parse_obj
from csm.mesh.io.off import count_off, format_off, parse_off
from csm.mesh.io.ply import counts_ply, format_ply, parse_ply
from csm.mesh.io.raw import RawMesh, unread
from csm.mesh.io.stl import parse_stl
from csm.mesh.io.vtk import parse_vtk
from csm.mesh.polygons import PolygonMesh
from csm.mesh.shape import Mesh

_ONE: Mapping[str, Callable[[bytes], RawMesh]] = MappingProxyType(
    {
        ".off": parse_off,
        ".ply": parse_ply,
        ".obj": parse_obj,
        ".stl": parse_stl,
        ".npz": parse_npz,
        ".vtk": parse_vtk,
    }
)
_SEVERAL: Mapping[str, Callable[[bytes, Choice, Fetch], RawMesh]] = MappingProxyType(
    {".mat": lambda data, choose, _: parse_mat(data, choose), ".glb": parse_gltf, ".gltf": parse_gltf}
)

READABLE: tuple[str, ...] = (*_ONE, *_SEVERAL)
"""Suffixes of the formats that are read; each may be followed by .gz."""

WRITABLE: tuple[str, ...] = (".off", ".ply", ".obj")


def read_mesh(path: str | os.PathLike[str], name: str | None = None, choose: Choice = None) -> Mesh:
    """Read a triangle mesh; the suffix (.off .ply .obj .stl .npz .vtk .mat .glb .gltf, each also .gz) says the format.

    Vertex order and number are the file's: nothing is merged, split, dropped or scaled.  The triangles of an
    .stl file share no vertices and are not joined.  What the reader noticed is in the mesh's `notes`.

    Parameters
    ----------
    path
        The file.
    name
        Name of the mesh; without it the file name without suffix.
    choose
        Which shape of a file that holds several (.mat, .glb, .gltf): its number, counted from 0, or "all" to join them.

    Raises
    ------
    MeshError
        If the file is missing, damaged, of another format, not a triangle mesh, or a face refers to a vertex that
        does not exist (a 1-based file is named as such).
    """
    polygons = read_polygons(path, name, choose)
    with parsing(polygons.source, _format(polygons.source)):
        return polygons.triangles()


def read_polygons(path: str | os.PathLike[str], name: str | None = None, choose: Choice = None) -> PolygonMesh:
    """Read a mesh whose faces may have any number of corners, as it is in the file; see `read_mesh`.

    Raises
    ------
    MeshError
        As `read_mesh`, but for the corners of the faces.
    """
    if not isinstance(path, str | os.PathLike):
        raise ConfigError(f"a mesh is read from a file given by its path, got a {type(path).__name__}")
    given = os.fspath(path)
    if _is_missing(given):
        raise MeshError(f"{given}: there is no such file{_near(given)}")
    suffix = _format(given)
    try:
        data = read_bytes(given)
    except DataError as error:
        raise MeshError(str(error)) from error.__cause__
    if not data:
        raise MeshError(f"{given}: the file is empty")
    with parsing(given, suffix):
        raw = _parsed(data, given, suffix, choose)
        return PolygonMesh(raw.vertices, raw.corners, raw.sizes, name or _stem(given), given, raw.notes)


def _is_missing(path: str) -> bool:
    try:
        os.lstat(path)
    except FileNotFoundError:
        return True
    except (OSError, ValueError):
        return False  # reading says what is wrong with the name
    return False


def _near(path: str) -> str:
    """Offer the files beside a missing one whose names are most like it."""
    try:
        names = os.listdir(os.path.dirname(path) or ".")
    except OSError:
        return ""
    close = difflib.get_close_matches(os.path.basename(path), names, n=2, cutoff=0.85)
    return f"; did you mean {' or '.join(close)}?" if close else ""


def _format(path: str) -> str:
    """Return the suffix that says the format, in lower case."""
    file = Path(path[:-3] if path.lower().endswith(".gz") else path)
    if os.path.isdir(path):
        raise MeshError(f"{path}: this is a folder, wanted a mesh; csm match folder={path} matches all that are in it")
    if file.suffix.lower() not in READABLE:
        raise MeshError(
            f"{path}: csm does not read {file.suffix or 'files without a suffix'}; wanted {_list(READABLE)}, "
            "each also as .gz"
        )
    return file.suffix.lower()


def _stem(path: str) -> str:
    return Path(path[:-3] if path.lower().endswith(".gz") else path).stem


def _parsed(data: bytes, path: str, suffix: str, choose: Choice) -> RawMesh:
    notes: tuple[str, ...] = ()
    if path.lower().endswith(".gz"):
        data, left = inflate(data, limit=most_unpacked(len(data)))
        notes = (unread(left, "byte", "the compressed data"),) if left else ()
    if suffix in _SEVERAL:
        raw = _SEVERAL[suffix](data, choose, lambda name: read_bytes(Path(path).parent / name))
    elif choose in (None, 0, "all"):
        raw = _ONE[suffix](data)
    else:
        raise MeshError(f"a {suffix} file holds one shape, so there is no choose={choose!r}")
    return replace(raw, notes=notes + raw.notes)


def count_vertices(path: str | os.PathLike[str]) -> int:
    """Return the number of vertices of a mesh file, from the header alone for .off and .ply.

    Raises
    ------
    MeshError
        As `read_polygons`.
    """
    given = os.fspath(path)
    heads: dict[str, Callable[[bytes], int]] = {".off": count_off, ".ply": lambda data: counts_ply(data)[0]}
    count = heads.get(Path(given).suffix.lower())
    if count is None:
        return read_polygons(given).n_vertices
    try:
        return count(read_bytes_of_head(given))
    except DataError as error:
        raise MeshError(str(error)) from error.__cause__
    except (MeshError, ValueError):  # a head that is longer than usual, or damage, which the reader names
        return read_polygons(given).n_vertices


def write_mesh(path: str | os.PathLike[str], mesh: Mesh, colors: NDArray[Any] | None = None) -> None:
    """Write a mesh atomically as .off, .ply (binary, float64) or .obj; it reads back with the same bits.

    Parameters
    ----------
    path
        The file; its suffix chooses the format.
    mesh
        What to write; `csm.mesh.as_mesh` makes it of arrays and of objects of other libraries.
    colors
        Shape (N, 3), uint8 red, green, blue per vertex; .ply and .off only.

    Raises
    ------
    ConfigError
        If it is no path and mesh, or the two are exchanged.
    MeshError
        If the suffix cannot be written or the colours do not fit.
    DataError
        If the file cannot be written there.
    """
    require_path_and(path, mesh, Mesh, "write_mesh")
    suffix = Path(path).suffix.lower()
    if suffix not in WRITABLE:
        raise MeshError(f"{path}: csm does not write {suffix or 'files without a suffix'}; wanted {_list(WRITABLE)}")
    if colors is not None:
        if suffix == ".obj":
            raise MeshError(f"{path}: OBJ has no vertex colours; write a .ply file")
        colors = np.asarray(colors)
        if colors.shape != (mesh.n_vertices, 3) or colors.dtype != np.uint8:
            raise MeshError(
                f"{path}: colours are {colors.dtype} of shape {colors.shape}, wanted uint8 ({mesh.n_vertices}, 3)"
            )
    with atomic_path(path) as temporary:
        temporary.write_bytes(_formatted(suffix, mesh, colors))


def _formatted(suffix: str, mesh: Mesh, colors: NDArray[np.uint8] | None) -> bytes:
    if suffix == ".obj":
        return format_obj(mesh)
    return format_off(mesh, colors) if suffix == ".off" else format_ply(mesh, colors)


def _list(suffixes: tuple[str, ...]) -> str:
    return ", ".join(suffixes[:-1]) + " or " + suffixes[-1]
