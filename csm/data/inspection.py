"""Inspect all shapes of a set: sizes, findings, and whether the maps can be read."""

from __future__ import annotations

from dataclasses import dataclass

from csm._progress import progress_bar
from csm.data.folders import FolderSet
from csm.errors import CsmError
from csm.mesh.check import Finding, check
from csm.mesh.shape import Mesh


@dataclass(frozen=True)
class Inspected:
    """What was found about one shape.

    Parameters
    ----------
    name
        Name of the shape.
    n_vertices, n_faces, area
        Sizes; the area in squared units of the file.  Zero if the mesh cannot be read.
    findings
        Of `csm.mesh.check.check`.
    problems
        Why the mesh or its map cannot be read.
    """

    name: str
    n_vertices: int = 0
    n_faces: int = 0
    area: float = 0.0
    findings: tuple[Finding, ...] = ()
    problems: tuple[str, ...] = ()

    @property
    def usable(self) -> bool:
        """Whether operators can be built on the shape and its map, if it has one, can be read."""
        return not self.problems and all(finding.severity == "note" for finding in self.findings)


def inspect(shapes: FolderSet, progress: bool = True) -> tuple[Inspected, ...]:
    """Read and check every shape of a set, one after the other; nothing is raised for a bad one."""
    with progress_bar(shapes.names, desc=f"check {shapes.name}", unit="shape", disable=not progress) as bar:
        rows = []
        for name in bar:
            bar.set_postfix_str(name, refresh=False)
            rows.append(_inspect_one(shapes, name))
    return tuple(rows)


def _inspect_one(shapes: FolderSet, name: str) -> Inspected:
    try:
        mesh = shapes.mesh(name)
    except CsmError as error:
        return Inspected(name, problems=(str(error),))
    return Inspected(name, mesh.n_vertices, mesh.n_faces, mesh.area, check(mesh), _map_problems(shapes, name, mesh))


def _map_problems(shapes: FolderSet, name: str, mesh: Mesh) -> tuple[str, ...]:
    if shapes.entry(name).truth is None:
        return ()  # `FolderSet.missing` names it
    try:
        shapes.with_maps(name, mesh)
    except CsmError as error:
        return (str(error),)
    return ()
