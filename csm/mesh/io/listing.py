"""The meshes of a folder, and which files of it are left out as none of its own."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from csm.mesh.io.files import list_files
from csm.mesh.io.meshes import READABLE
from csm.mesh.io.owned import COLLECTION, MATCH, files_of, is_as_left

ARRAYS = (".npz", ".mat")
"""Suffixes of files that may hold something else than a mesh."""

GEOMETRY = tuple(suffix for suffix in READABLE if suffix not in ARRAYS)
"""Suffixes of files that hold a mesh."""


class Listed(NamedTuple):
    """The mesh files of a folder, and the names of those left out: written by a match, and archives of arrays."""

    files: list[Path]
    written: list[str]
    arrays: list[str]

    @property
    def left_out(self) -> str:
        """What was left out and why, as a phrase; empty for nothing."""
        said = []
        if self.written:
            said.append(f"{_names(self.written)}, which csm match has written there")
        if self.arrays:
            said.append(f"{_names(self.arrays)}, which may be no {'mesh' if len(self.arrays) == 1 else 'meshes'}")
        return ", and ".join(said)


def listed_meshes(folder: Path) -> Listed:
    """Return the mesh files of a folder in natural order; archives of arrays count only where there is nothing else.

    Meshes that a match has written into the folder, and that are as it left them, are no shapes of it.
    """
    written = written_meshes(folder)
    meshes, arrays = (
        [path for path in list_files(folder, *suffixes) if path.name not in written] for suffixes in (GEOMETRY, ARRAYS)
    )
    named = sorted(name for name in written if Path(name).suffix in GEOMETRY)
    return Listed(meshes or arrays, named, [path.name for path in arrays] if meshes else [])


def written_meshes(folder: Path) -> frozenset[str]:
    """Return the names of the meshes in a folder that a match has written there, and that are as it left them."""
    known = {**files_of(folder / MATCH), **files_of(folder / COLLECTION)}
    here = {name: digest for name, digest in known.items() if "/" not in name and Path(name).suffix in READABLE}
    return frozenset(name for name, digest in here.items() if is_as_left(folder / name, digest))


def _names(names: Sequence[str]) -> str:
    if len(names) > 5:
        return f"{', '.join(names[:5])} and {len(names) - 5} more"
    return " and ".join(filter(None, [", ".join(names[:-1]), names[-1]]))
