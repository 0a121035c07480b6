"""What is matched: a mesh as it was given, its cleaned copy that is computed on, and what is to be said of both."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, TypeAlias, get_args

import numpy as np

from csm._types import IntArray
from csm.errors import ConfigError
from csm.matching.barycentric import BarycentricMap
from csm.matching.maps import VertexMap
from csm.matching.way import Way
from csm.mesh.check import Finding, check
from csm.mesh.clean import Cleaned, clean
from csm.mesh.inputs import MeshLike, as_polygons
from csm.mesh.polygons import PolygonMesh, triangulated
from csm.mesh.shape import Mesh

Cleaning: TypeAlias = Literal["auto", "off"]

_MENDED = {
    "inside_out": "orient",
    "inconsistent_orientation": "orient",
    "duplicate_vertices": "weld",
    "debris": "debris",
    "unreferenced_vertices": "unreferenced",
}
"""Findings that need no word of their own where this step of cleaning has one."""


@dataclass(frozen=True, eq=False)
class Subject:
    """One of two meshes to match.

    Parameters
    ----------
    given
        The mesh with the vertices that results refer to; polygons are triangulated on these vertices.
    cleaned
        What descriptors are computed on, with the map from the given vertices.
    findings
        What `csm.check` finds in the given mesh and cleaning did not mend.
    """

    given: Mesh
    cleaned: Cleaned
    findings: tuple[Finding, ...]

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences on the file, on what was mended for the computation, and on what remains."""
        said = list(self.given.notes)
        if self.cleaned.text:
            said.append(f"cleaned for the computation, results are on the vertices of the file: {self.cleaned.text}")
        remaining = "; ".join(finding.text for finding in self.findings)
        return (*said, *([remaining] if remaining else []))


def subject_of(mesh: MeshLike, cleaning: Cleaning = "auto", name: str = "mesh") -> Subject:
    """Read a mesh if it is a file, check it, and clean it unless cleaning is "off".

    Debris and vertices in no face are left out of the computation in either case.

    Parameters
    ----------
    mesh
        What `csm.mesh.inputs.as_mesh` takes, also with polygons.
    cleaning
        Whether to mend a copy for the computation.
    name
        What a mesh is called that has no name of its own.

    Raises
    ------
    ConfigError
        If it is no mesh, or there is no such way of cleaning.
    MeshError
        If the file cannot be read, or cleaning is off and the mesh cannot be used.
    """
    if not isinstance(cleaning, str) or cleaning not in get_args(Cleaning):
        shown = cleaning if isinstance(cleaning, str) else f"a {type(cleaning).__name__}"
        raise ConfigError(f"clean={shown}; wanted {' or '.join(get_args(Cleaning))}")
    polygons = as_polygons(mesh, name)
    if isinstance(polygons, PolygonMesh) and (cleaning == "off" or polygons.all_triangles):
        polygons = polygons.triangles()
    given = polygons if isinstance(polygons, Mesh) else triangulated(polygons).mesh
    cleaned = clean(polygons) if cleaning == "auto" else clean(polygons, weld=False, split=False, orient=False)
    mended = {mend.kind for mend in cleaned.mends}
    findings = tuple(f for f in check(given) if _MENDED.get(f.kind) not in mended)
    if cleaned.mends:
        left = {finding.kind for finding in check(cleaned.mesh)}
        findings = tuple(finding for finding in findings if finding.kind in left)
    return Subject(given, cleaned, findings)


def on_given_vertices(found: VertexMap, source: Subject, target: Subject) -> VertexMap:
    """Return a map between the cleaned meshes as one between the given ones; -1 for vertices that were left out."""
    at = source.cleaned.vertex_map
    mapped = np.where(at >= 0, found.indices[at], -1)
    indices: IntArray = np.where(mapped >= 0, target.cleaned.origin[mapped], -1)
    return VertexMap(indices, target.given.n_vertices, source.given.name, target.given.name)


def on_given_faces(found: BarycentricMap, source: Subject, target: Subject) -> BarycentricMap:
    """Return a map into faces between the cleaned meshes as one between the given ones; -1 as in `on_given_vertices`.

    A face of the cleaned target is one of the given mesh between the same places, perhaps turned or with corners that
    were welded; where the given mesh has several such, the first.
    """
    at, given = source.cleaned.vertex_map, target.given
    names = (source.given.name, target.given.name)
    mapped = np.where(at >= 0, found.faces[at], -1)
    places = np.where(target.cleaned.vertex_map >= 0, target.cleaned.origin[target.cleaned.vertex_map], -1)
    corners = places[given.faces]
    wanted = np.where(mapped[:, None] >= 0, target.cleaned.origin[found.target_faces[mapped]], -1)
    faces = _rows_of(np.sort(wanted, axis=1), np.sort(corners, axis=1))
    faces[mapped < 0] = -1
    same = corners[faces][:, :, None] == wanted[:, None, :]  # corner of the given face, corner of the cleaned one
    weights = np.einsum("nij,nj->ni", same, np.where(at[:, None] >= 0, found.weights[at], 0.0))
    return BarycentricMap(faces, weights, given.faces, given.n_vertices, *names)


def _rows_of(wanted: IntArray, rows: IntArray) -> IntArray:
    """Return where each wanted row is among some rows, the first of equal ones; -1 where it is not."""
    _, first, which = np.unique(np.concatenate([rows, wanted]), axis=0, return_index=True, return_inverse=True)
    found: IntArray = first[which.ravel()[len(rows) :]]
    return np.where(found < len(rows), found, -1)


def on_given(found: Way, source: Subject, target: Subject) -> Way:
    """Return one way between the cleaned meshes as one between the given ones; a functional map stays as it is."""
    precise, known, at = found.precise, found.confidence, source.cleaned.vertex_map
    confidence = known and replace(
        known, values=np.where(at >= 0, known.values[at], 0.0), distance=np.where(at >= 0, known.distance[at], np.inf)
    )
    return Way(
        on_given_vertices(found.vertex_map, source, target),
        found.functional_map,
        confidence,
        None if precise is None else lambda: on_given_faces(precise(), source, target),
    )
