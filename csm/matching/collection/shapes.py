"""Which shapes make up a collection: the meshes of a folder, or those that are given, with their names."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TypeAlias

from csm._counts import counted
from csm.errors import ConfigError, DataError
from csm.matching.subjects import Subject
from csm.mesh.inputs import HasFaces, MeshLike
from csm.mesh.io import READABLE, list_files
from csm.mesh.io.owned import COLLECTION, MATCH, files_of, is_as_left
from csm.mesh.polygons import PolygonMesh

_log = logging.getLogger(__name__)

_ARRAYS = (".npz", ".mat")  # of files, which may hold something else than a mesh

Shapes: TypeAlias = str | os.PathLike[str] | Sequence[MeshLike]
"""A folder, or meshes in any form that `csm.match` takes."""


def named_shapes(shapes: Shapes) -> dict[str, MeshLike]:
    """Return meshes, or those of a folder, by the names that those without one of their own get.

    Raises
    ------
    DataError
        If it is a folder without at least two meshes.
    ConfigError
        If there are fewer than two shapes, or what is given is neither a folder nor several of them.
    """
    if isinstance(shapes, str | os.PathLike):
        return {path.name: path for path in mesh_files(shapes)}
    if isinstance(shapes, HasFaces | PolygonMesh) or not isinstance(shapes, Iterable):
        raise ConfigError(
            f"a collection: wanted a folder, or a list of two or more meshes; got a {type(shapes).__name__}"
        )
    found = {f"shape{i}": mesh for i, mesh in enumerate(shapes)}
    if len(found) < 2:
        raise ConfigError(f"a collection of {counted(len(found), 'shape')}: wanted two or more")
    return found


def mesh_files(folder: str | os.PathLike[str]) -> list[Path]:
    """Return the mesh files of a folder in natural order; archives of arrays count only where there is nothing else.

    Meshes that a match has written into the folder, and that are as it left them, are no shapes of it.  They are left
    out, which is logged.

    Raises
    ------
    DataError
        If there is no such folder, it has fewer than two meshes, or two of them have one name.
    """
    place = Path(folder).expanduser()
    if not place.is_dir():
        raise DataError(f"{folder}: there is no such folder; wanted one with two or more meshes")
    plain = tuple(suffix for suffix in READABLE if suffix not in _ARRAYS)
    known = {**files_of(place / MATCH), **files_of(place / COLLECTION)}
    written = {name for name, digest in known.items() if "/" not in name and is_as_left(place / name, digest)}
    found = [[p for p in list_files(place, *suffixes) if p.name not in written] for suffixes in (plain, _ARRAYS)]
    files = found[0] or found[1]
    left_out = sorted(name for name in written if Path(name).suffix in plain)
    besides = f" besides {' and '.join(left_out)}, which csm match has written there" if left_out else ""
    if len(files) < 2:
        raise DataError(
            f"{folder}: has {counted(len(files), 'mesh file')}{besides}, wanted two or more; csm reads "
            f"{', '.join(READABLE)}, and takes the files of the folder itself, not of folders in it"
        )
    if besides:
        _log.warning("%s: %s shapes%s", folder, len(files), besides)
    return files


def require_names(subjects: Sequence[Subject]) -> None:
    """Raise a DataError if two shapes have one name, by which maps and files are called."""
    seen: dict[str, Subject] = {}
    for subject in subjects:
        other = seen.setdefault(subject.given.name, subject)
        if other is not subject:
            here, there = subject.given.source or "a mesh", other.given.source or "another mesh"
            raise DataError(
                f"{here} and {there} have one name, {subject.given.name!r}, by which maps and files are called; "
                "rename one of them"
            )
