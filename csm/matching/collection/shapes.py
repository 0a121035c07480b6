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
from csm.mesh.io import READABLE
from csm.mesh.io.listing import listed_meshes
from csm.mesh.polygons import PolygonMesh

_log = logging.getLogger(__name__)

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
    found = listed_meshes(place)
    besides = f" besides {found.left_out}" if found.left_out else ""
    if len(found.files) < 2:
        raise DataError(
            f"{folder}: has {counted(len(found.files), 'mesh file')}{besides}, wanted two or more; csm reads "
            f"{', '.join(READABLE)}, and takes the files of the folder itself, not of folders in it"
        )
    if besides:
        _log.warning("%s: %s shapes%s", folder, len(found.files), besides)
    return found.files


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
