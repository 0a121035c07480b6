"""Synthetic damage of a mesh: noise, slivers, missing parts, and topological noise, a bridge between near parts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial.distance import cdist

from csm._types import IntArray
from csm.errors import MeshError
from csm.mesh.mending import split
from csm.mesh.remesh.edge_moves import edge_table, independent
from csm.mesh.remesh.edge_moves import split as split_edges
from csm.mesh.remesh.remesher import require_fit
from csm.mesh.shape import Mesh
from csm.mesh.topology import components, edge_graph, half_edges


@dataclass(frozen=True, eq=False)
class Damaged:
    """A damaged mesh, and for each of its vertices the number that it has on the original, -1 for none, shape (N',)."""

    mesh: Mesh
    kept: IntArray


def with_noise(mesh: Mesh, strength: float, seed: int = 0) -> Damaged:
    """Move every vertex by a Gaussian vector.

    Parameters
    ----------
    strength
        Standard deviation of each coordinate, in mean edge lengths.
    seed
        Of the draw.
    """
    lengths = np.linalg.norm(np.diff(mesh.corners[:, [0, 1, 2, 0]], axis=1), axis=2)
    shift = np.random.default_rng(seed).standard_normal(mesh.vertices.shape)
    moved = mesh.vertices + strength * lengths.mean() * shift
    return Damaged(Mesh(moved, mesh.faces, mesh.name), np.arange(mesh.n_vertices))


def with_slivers(mesh: Mesh, share: float, seed: int = 0) -> Damaged:
    """Split drawn edges close to one of their ends, which makes thin triangles and leaves the surface as it is.

    Parameters
    ----------
    mesh
        A manifold, oriented mesh.
    share
        How many vertices are added, as a share of those that are there; they come last, each 2 to 10 % of its edge
        from one of the ends.
    seed
        Of the draw.

    Raises
    ------
    MeshError
        If the mesh is not manifold and oriented.

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> thin = with_slivers(square, 0.25)
    >>> thin.mesh.n_vertices, thin.kept.tolist(), float(thin.mesh.area)
    (5, [0, 1, 2, 3, -1], 1.0)
    """
    require_fit(mesh)
    rng = np.random.default_rng(seed)
    vertices, faces = mesh.vertices, mesh.faces
    wanted = mesh.n_vertices + round(share * mesh.n_vertices)
    while len(vertices) < wanted:
        table = edge_table(faces)
        edges = independent(table, np.arange(len(table.ends)), rng.random(len(table.ends)), len(faces))
        edges = edges[: wanted - len(vertices)]
        near, far = rng.permuted(table.ends[edges], axis=1).T
        t = rng.uniform(0.02, 0.1, (len(edges), 1))
        faces = split_edges(faces, table, edges, len(vertices))
        vertices = np.concatenate([vertices, (1 - t) * vertices[near] + t * vertices[far]])
    kept = np.concatenate([np.arange(mesh.n_vertices), np.full(len(vertices) - mesh.n_vertices, -1)])
    return Damaged(Mesh(vertices, faces, mesh.name), kept)


def without_part(mesh: Mesh, centre: int, fraction: float) -> Damaged:
    """Cut away the part around a vertex; of what is left the largest component is kept.

    Parameters
    ----------
    centre
        The vertex in the middle of what is cut away.
    fraction
        How much of the area that is: the faces whose corners are all among the vertices nearest to `centre` along
        edges, until their share of the area is reached.

    Raises
    ------
    MeshError
        If nothing would be left.
    """
    distance = np.asarray(dijkstra(edge_graph(mesh.vertices, mesh.faces), indices=[centre]))[0]
    reach = distance[mesh.faces].max(axis=1)
    order = np.argsort(reach, kind="stable")
    cut = order[np.cumsum(mesh.face_areas[order]) <= fraction * mesh.area]
    faces = np.delete(mesh.faces, cut, axis=0)
    if len(faces) == 0:
        raise MeshError(f"{mesh.label}: cutting {fraction:g} of the area away leaves nothing")
    return _largest_component(mesh, faces)


def grown_together(mesh: Mesh, far: float = 0.5) -> Damaged:
    """Join the two nearest parts of the surface by a bridge, as happens to touching limbs in scans.

    One face at either end gives way to a tube of six; vertices stay, and a closed surface gets one more handle.

    Parameters
    ----------
    far
        How long the way along the surface must at least be between the two ends, in units of sqrt(area).

    Raises
    ------
    MeshError
        If no two points are that far apart, or the faces around them touch.
    """
    first, second = _contact(mesh, far * np.sqrt(mesh.area))
    a, b = mesh.faces[first], mesh.faces[second][::-1]
    if (np.isin(mesh.faces, a).any(axis=1) & np.isin(mesh.faces, b).any(axis=1)).any():
        raise MeshError(f"{mesh.label}: the two ends of the bridge touch; ask for parts that are farther apart")
    b = min((np.roll(b, k) for k in range(3)), key=lambda turned: _gap(mesh, a, turned))
    tube = [[(a[i], a[(i + 1) % 3], b[(i + 1) % 3]), (a[i], b[(i + 1) % 3], b[i])] for i in range(3)]
    faces = np.concatenate([np.delete(mesh.faces, [first, second], axis=0), np.reshape(tube, (6, 3))])
    return Damaged(Mesh(mesh.vertices, faces, mesh.name), np.arange(mesh.n_vertices))


def _largest_component(mesh: Mesh, faces: IntArray) -> Damaged:
    """Keep the largest piece; where faces meet in a vertex only, it has a vertex of its own for each of their fans."""
    areas = Mesh(mesh.vertices, faces, mesh.name).face_areas
    faces, origin = split(mesh.vertices, faces)
    label = components(*half_edges(faces), len(origin))[faces[:, 0]]
    kept, inverse = np.unique(faces[label == np.bincount(label, areas).argmax()], return_inverse=True)
    return Damaged(Mesh(mesh.vertices[origin[kept]], inverse.reshape(-1, 3), mesh.name), origin[kept])


def _contact(mesh: Mesh, far: float) -> tuple[int, int]:
    """Return two faces, near in space and `far` along the surface: the best of a sample, then the best around it."""
    graph = edge_graph(mesh.vertices, mesh.faces)
    sample = np.unique(np.linspace(0, mesh.n_vertices - 1, 400).astype(np.int64))
    for _ in range(2):
        begin, end = _nearest_of_far(mesh, graph, sample, far)
        gaps = np.linalg.norm(mesh.vertices - mesh.vertices[begin], axis=1)
        sample = np.argsort(gaps, kind="stable")[:400]
    first = np.flatnonzero((mesh.faces == begin).any(axis=1))
    second = np.flatnonzero((mesh.faces == end).any(axis=1))
    middles = mesh.corners.mean(axis=1)
    between = np.linalg.norm(middles[first][:, None] - middles[second], axis=2)
    i, j = np.unravel_index(between.argmin(), between.shape)
    return int(first[i]), int(second[j])


def _nearest_of_far(mesh: Mesh, graph: csr_array, sample: IntArray, far: float) -> tuple[int, int]:
    way = np.asarray(dijkstra(graph, indices=sample))
    gaps = cdist(mesh.vertices[sample], mesh.vertices)
    gaps[~((way >= far) & np.isfinite(way))] = np.inf
    if np.isinf(gaps).all():
        raise MeshError(f"{mesh.label}: no two points are {far:g} apart along the surface; ask for less")
    i, end = np.unravel_index(gaps.argmin(), gaps.shape)
    return int(sample[i]), int(end)


def _gap(mesh: Mesh, a: IntArray, b: IntArray) -> float:
    return float(np.linalg.norm(mesh.vertices[a] - mesh.vertices[b], axis=1).sum())
