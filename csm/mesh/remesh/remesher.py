"""Other triangulations of a shape, with exact ground truth: what tests across resolutions and connectivities need.

`refine` keeps the vertices and adds some, as the LPS-data sets do (Wang et al. 2019: the first 6890 vertices of
its FAUST shapes are the original ones); `remesh` makes an independent triangulation, as the LRVD sets are (Yan et al.
2014).
"""

from __future__ import annotations

import logging
from dataclasses import dataclass

import numpy as np

from csm._types import FloatArray
from csm.errors import MeshError
from csm.mesh.check import check
from csm.mesh.correspondence import Direction, PointMap
from csm.mesh.remesh.edge_moves import adjacency, edge_table
from csm.mesh.remesh.editable import LONG, EditableMesh
from csm.mesh.shape import Mesh
from csm.mesh.surface import Surface, SurfacePoints

_log = logging.getLogger(__name__)

_UNFIT = {
    "non_manifold_edges",
    "non_manifold_vertices",
    "inconsistent_orientation",
    "duplicate_faces",
    "zero_area_faces",
}

GRADING = 0.9
"""How far `remesh` follows the density of its input: 0 makes all edges alike, 1 keeps their proportions.  At 0.9 the
spread of edge lengths of FAUST with 5000 vertices (standard deviation / mean) is that of its LRVD remeshing (0.47)."""


@dataclass(frozen=True, eq=False)
class Remeshed:
    """A new triangulation of a shape, and where the old vertices are on it.

    Parameters
    ----------
    mesh
        The new mesh; it has the name and scale of the old one.
    truth
        Map from the old vertices (the template side) to the vertices of the new mesh.
    location
        Where each old vertex lies on the new surface, more finely than `truth`: face and barycentric weights.
    """

    mesh: Mesh
    truth: PointMap
    location: SurfacePoints


def refine(mesh: Mesh, n_vertices: int, seed: int = 0) -> Remeshed:
    """Return a finer mesh that has the vertices of `mesh` first and in place, and new ones on its surface.

    The longest edges are split until the count is reached; edges are flipped towards Delaunay and the new vertices
    relaxed along the surface, so the triangulation is another one although the old vertices are kept.

    Parameters
    ----------
    mesh
        A manifold, oriented mesh, open or closed.
    n_vertices
        Number of vertices of the result, at least that of `mesh`.
    seed
        Seed of the random choices; the same seed gives the same mesh.

    Raises
    ------
    MeshError
        If the mesh is not manifold and oriented, or `n_vertices` is below its own count.

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> finer = refine(square, 50)
    >>> finer.mesh.n_vertices, bool((finer.mesh.vertices[:4] == square.vertices).all())
    (50, True)
    """
    require_fit(mesh)
    if n_vertices < mesh.n_vertices:
        raise MeshError(
            f"{mesh.label}: cannot refine {mesh.n_vertices} vertices to {n_vertices}; ask for more, or use `remesh`"
        )
    editable = EditableMesh(mesh, np.ones(mesh.n_vertices), mesh.n_vertices, np.random.default_rng(seed))
    while editable.n < n_vertices:
        longest = float(editable.relative_lengths(editable.table()).max())
        editable.split_longest(n_vertices - editable.n, 0.8 * longest)
        editable.flip()
        editable.relax()
    for _ in range(5):
        editable.relax()
        editable.flip()
    truth = PointMap.identity(mesh.n_vertices, editable.n, mesh.name)
    finer = Mesh(editable.vertices, editable.faces, mesh.name, mesh.scale)
    location = Surface(finer).at_vertices()
    return Remeshed(finer, truth, location[: mesh.n_vertices])


def remesh(mesh: Mesh, n_vertices: int, seed: int = 0, contrast: float = 1.0) -> Remeshed:
    """Return an independent triangulation of the surface of `mesh` with other vertices, in random order.

    Edges are split, collapsed and flipped and vertices moved along the surface until edges have the wanted length
    (isotropic remeshing after Botsch and Kobbelt 2004), which follows the density of `mesh` (`GRADING`).  Corners of
    the boundary are kept.  The ground truth of an old vertex is the nearest corner of the face that its closest
    point on the new surface lies in, searched from the new vertex nearest along the old surface.

    Parameters
    ----------
    mesh
        A manifold, oriented mesh, open or closed.
    n_vertices
        Number of vertices of the result.
    seed
        Seed of the random choices; the same seed gives the same mesh.
    contrast
        How many times longer edges are at one end of the shape than at the other, along a drawn direction, beside what
        they follow of `mesh`: with 4 the vertices are up to 16 times as dense.

    Raises
    ------
    MeshError
        If the mesh is not manifold and oriented, or its topology and corners do not allow so few vertices.
    """
    require_fit(mesh)
    rng = np.random.default_rng(seed)
    sizes = _graded_sizes(mesh)
    if contrast != 1:
        sizes = sizes * contrast ** _along(mesh, rng.standard_normal(3))
    area_factor = np.sqrt(2 / np.sqrt(3) * (mesh.face_areas / sizes[mesh.faces].mean(axis=1) ** 2).sum() / n_vertices)
    editable = EditableMesh(mesh, sizes * area_factor, 0, rng)
    editable.scatter(0.3)
    for _ in range(6):
        for _ in range(5):
            editable.split_longest(editable.n, LONG)
        for _ in range(5):
            editable.collapse_shortest(editable.n, 4 / 5)
        editable.flip()
        editable.relax()
        editable.sizes = editable.sizes * np.sqrt(np.clip(editable.n / n_vertices, 0.9, 1.1))
    _reach(editable, n_vertices, mesh.name)
    for _ in range(5):
        editable.flip()
        editable.relax()
    editable.flip()
    return _with_truth(mesh, editable, rng)


def _reach(editable: EditableMesh, n_vertices: int, name: str) -> None:
    """Split or collapse the last few edges to make the count exact."""
    while editable.n != n_vertices:
        missing = n_vertices - editable.n
        ratio = editable.relative_lengths(editable.table())
        if missing > 0:
            done = editable.split_longest(missing, 0.85 * float(ratio.max()))
        else:
            done = editable.collapse_shortest(
                -missing, 1.25 * float(np.quantile(ratio, min(1.0, -missing / editable.n)))
            )
            done = done or editable.collapse_shortest(1, np.inf, careful=False)
        if not done:
            raise MeshError(
                f"{name}: the remeshing stops at {editable.n} vertices, {n_vertices} were wanted: no edge can be "
                "collapsed without changing the topology or turning a face; ask for more vertices"
            )
        editable.flip()


def _with_truth(mesh: Mesh, editable: EditableMesh, rng: np.random.Generator) -> Remeshed:
    """Number the vertices and faces anew at random and look up where the old vertices are."""
    order = rng.permutation(editable.n)
    number = np.argsort(order)
    new = Mesh(editable.vertices[order], number[rng.permutation(editable.faces)], mesh.name, mesh.scale)
    start = Surface(mesh).nearest_marks(editable.place[order])
    surface = Surface(new)
    location = surface.walk(mesh.vertices, surface.at_vertices().faces[start])
    truth = PointMap(location.nearest_corner(new), Direction.TEMPLATE_TO_SHAPE, new.n_vertices, mesh.name)
    return Remeshed(new, truth, location)


def _graded_sizes(mesh: Mesh) -> FloatArray:
    """Mean edge length around each vertex, smoothed over three rings, to the power `GRADING`, shape (N,)."""
    table = edge_table(mesh.faces)
    length = np.linalg.norm(mesh.vertices[table.ends[:, 0]] - mesh.vertices[table.ends[:, 1]], axis=1)
    link = adjacency(table, mesh.n_vertices)
    degree = np.diff(link.indptr)
    size: FloatArray = np.bincount(table.ends.ravel(), np.repeat(length, 2), mesh.n_vertices) / degree
    for _ in range(3):
        size = (size + link @ size) / (1 + degree)
    return size**GRADING


def _along(mesh: Mesh, direction: FloatArray) -> FloatArray:
    """Return how far each vertex lies along a direction, from 0 at one end of the shape to 1 at the other, (N,)."""
    height = mesh.vertices @ direction
    share: FloatArray = (height - height.min()) / np.ptp(height)
    return share


def require_fit(mesh: Mesh) -> None:
    """Raise a MeshError if edges of a mesh cannot be split, flipped and collapsed: it is no oriented manifold."""
    unfit = [f.text for f in check(mesh) if f.severity == "error" or f.kind in _UNFIT]
    if unfit:
        raise MeshError(
            f"{mesh.label}: {'; '.join(unfit)}. Remeshing needs a manifold, oriented mesh; mend the file and try again"
        )
