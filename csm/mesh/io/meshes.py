"""`read_mesh` and `write_mesh` for all mesh formats."""

from __future__ import annotations

import io
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from csm.errors import DataError, MeshError
from csm.mesh.io.files import atomic_path, read_bytes, read_bytes_of_head
from csm.mesh.io.matlab import parse_mat
from csm.mesh.io.obj import format_obj, parse_obj
from csm.mesh.io.off import count_off, format_off, parse_off
from csm.mesh.io.ply import counts_ply, format_ply, parse_ply
from csm.mesh.io.raw import RawMesh
from csm.mesh.io.stl import parse_stl
from csm.mesh.shape import Mesh


def parse_npz(data: bytes) -> RawMesh:
    """Read the arrays `vertices` (N, 3) and `faces` (M, 3), 0-based, of a NumPy archive; pickles are refused."""
    if not data.startswith(b"PK"):
        raise MeshError("this is no NumPy archive")
    with np.load(io.BytesIO(data), allow_pickle=False) as archive:
        if not {"vertices", "faces"} <= set(archive.files):
            raise MeshError(f"wanted the arrays 'vertices' and 'faces', found {', '.join(archive.files) or 'none'}")
        try:
            return RawMesh(archive["vertices"], archive["faces"])
        except ValueError as error:
            raise MeshError("'vertices' or 'faces' holds Python objects, wanted numbers") from error


_PARSERS: Mapping[str, Callable[[bytes], RawMesh]] = MappingProxyType(
    {
        ".off": parse_off,
        ".ply": parse_ply,
        ".obj": parse_obj,
        ".stl": parse_stl,
        ".npz": parse_npz,
        ".mat": parse_mat,
    }
)

READABLE: tuple[str, ...] = tuple(_PARSERS)
WRITABLE: tuple[str, ...] = (".off", ".ply", ".obj")


def read_mesh(path: str | os.PathLike[str], name: str | None = None) -> Mesh:
    """Read a triangle mesh; the suffix (.off .ply .obj .stl .npz .mat) says the format.

    Vertex order and number are the file's: nothing is merged, split, dropped or scaled.  The triangles of an
    .stl file share no vertices and are not joined.

    Parameters
    ----------
    path
        The file.
    name
        Name of the mesh; without it the file name without suffix.

    Raises
    ------
    MeshError
        If the file is missing, damaged, of another format, not a triangle mesh, or a face refers to a vertex that
        does not exist (a 1-based file is named as such).
    """
    path = Path(path)
    parse = _PARSERS.get(path.suffix.lower())
    if parse is None:
        raise MeshError(
            f"{path}: csm does not read {path.suffix or 'files without a suffix'}; wanted {_list(READABLE)}"
        )
    raw = _parsed(path, parse)
    if raw.faces.dtype.kind not in "iu":
        raise MeshError(f"{path}: the faces are of type {raw.faces.dtype}, wanted integers")
    return Mesh(raw.vertices, raw.faces, name or path.stem, source=str(path))


def _parsed(path: Path, parse: Callable[[bytes], RawMesh]) -> RawMesh:
    try:
        data = read_bytes(path)
    except DataError as error:
        raise MeshError(str(error)) from error.__cause__
    if not data:
        raise MeshError(f"{path}: the file is empty")
    try:
        return parse(data)
    except MeshError as error:
        raise MeshError(f"{path}: {error}") from error.__cause__
    except Exception as error:  # a damaged file makes the libraries raise whatever they trip over
        raise MeshError(f"{path}: this is no {path.suffix} file, or it is damaged or cut short ({error})") from error


def count_vertices(path: Path) -> int:
    """Return the number of vertices of a mesh file, from the header alone for .off and .ply."""
    heads: dict[str, Callable[[bytes], int]] = {".off": count_off, ".ply": lambda data: counts_ply(data)[0]}
    count = heads.get(path.suffix.lower())
    if count is None:
        return read_mesh(path).n_vertices
    try:
        return count(read_bytes_of_head(path))
    except MeshError as error:
        raise MeshError(f"{path}: {error}") from None


def write_mesh(path: str | os.PathLike[str], mesh: Mesh, colors: NDArray[Any] | None = None) -> None:
    """Write a mesh atomically as .off, .ply (binary, float64) or .obj; it reads back with the same bits.

    Parameters
    ----------
    path
        The file; its suffix chooses the format.
    mesh
        What to write.
    colors
        Shape (N, 3), uint8 red, green, blue per vertex; .ply and .off only.

    Raises
    ------
    MeshError
        If the suffix cannot be written or the colours do not fit.
    """
    path = Path(path)
    suffix = path.suffix.lower()
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
