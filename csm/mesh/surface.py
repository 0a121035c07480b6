"""Points on a triangle surface: where the nearest point is, found by walking over neighbouring faces.

Walking keeps a point on its own sheet: a point of a thumb never jumps to the palm it nearly touches.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import dijkstra

from csm._types import BoolArray, FloatArray, IntArray
from csm.mesh.shape import Mesh
from csm.mesh.topology import half_edges


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """P points on the faces of a mesh.

    Parameters
    ----------
    faces
        Shape (P,): the face each point lies on.
    barycentric
        Shape (P, 3): its weights for the corners of that face; not negative, sum 1.
    """

    faces: IntArray
    barycentric: FloatArray

    def __getitem__(self, which: slice | IntArray | BoolArray) -> SurfacePoints:
        """Return some of the points."""
        return SurfacePoints(self.faces[which], self.barycentric[which])

    def interpolate(self, mesh: Mesh, values: FloatArray) -> FloatArray:
        """Interpolate per-vertex values of `mesh`, shape (N,) or (N, C), at the points, shape (P,) or (P, C)."""
        result: FloatArray = np.einsum("pk,pk...->p...", self.barycentric, values[mesh.faces[self.faces]])
        return result

    def nearest_corner(self, mesh: Mesh) -> IntArray:
        """Return the vertex of each point's face that is nearest to it, shape (P,)."""
        points = self.interpolate(mesh, mesh.vertices)
        distance = np.linalg.norm(mesh.corners[self.faces] - points[:, None], axis=2)
        corner: IntArray = mesh.faces[self.faces, distance.argmin(axis=1)]
        return corner


class Surface:
    """A mesh that answers where the point nearest to a given one is.

    Parameters
    ----------
    mesh
        Any triangle mesh without unreferenced vertices.
    """

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = mesh

    @cached_property
    def incidence(self) -> csr_array:
        """Vertex-face incidence, shape (N, M)."""
        m = self.mesh.n_faces
        rows, columns = self.mesh.faces.ravel(), np.repeat(np.arange(m), 3)
        return csr_array((np.ones(3 * m), (rows, columns)), shape=(self.mesh.n_vertices, m))

    @cached_property
    def around(self) -> csr_array:
        """Which faces share a vertex with a face (itself included), shape (M, M)."""
        return csr_array(self.incidence.T @ self.incidence)

    def at_vertices(self) -> SurfacePoints:
        """Return the vertices of the mesh as surface points."""
        face = self.incidence.indices[self.incidence.indptr[:-1]].astype(np.int64)
        return SurfacePoints(face, (self.mesh.faces[face] == np.arange(self.mesh.n_vertices)[:, None]).astype(float))

    @cached_property
    def spheres(self) -> tuple[FloatArray, FloatArray]:
        """Centre (M, 3) and radius (M,) of a sphere around each face."""
        centre = self.mesh.corners.mean(axis=1)
        return centre, np.linalg.norm(self.mesh.corners - centre[:, None], axis=2).max(axis=1)

    def walk(self, points: FloatArray, start: IntArray, max_steps: int = 50) -> SurfacePoints:
        """Return the locally nearest surface point for each point (P, 3), going downhill from its start face (P,).

        Each step looks at all faces that touch the present one and goes to the nearest; the walk ends where none is.
        """
        face = start.copy()
        weights, best = nearest_on_triangles(points, self.mesh.corners[face])
        moving = np.arange(len(points))
        for _ in range(max_steps):
            owner, candidate = self._candidates(points[moving], face[moving], best[moving])
            owner = moving[owner]
            w, d = nearest_on_triangles(points[owner], self.mesh.corners[candidate])
            order = np.lexsort((d, owner))
            first = np.flatnonzero(np.diff(owner[order], prepend=-1))
            least = order[first]
            least = least[d[least] < best[owner[least]] * (1 - 1e-12)]
            moving = owner[least]
            if moving.size == 0:
                break
            face[moving], weights[moving], best[moving] = candidate[least], w[least], d[least]
        return SurfacePoints(face, weights)

    def _candidates(self, points: FloatArray, face: IntArray, best: FloatArray) -> tuple[IntArray, IntArray]:
        """Pairs (point, face) of faces that touch a point's face and may be nearer than sqrt(best)."""
        count = np.diff(self.around.indptr)[face]
        owner = np.repeat(np.arange(len(face)), count)
        offset = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)
        candidate = self.around.indices[np.repeat(self.around.indptr[face], count) + offset].astype(np.int64)
        centre, radius = self.spheres
        gap = points[owner] - centre[candidate]
        near = np.einsum("pc,pc->p", gap, gap) < (radius[candidate] + np.sqrt(best)[owner]) ** 2
        return owner[near], candidate[near]

    def nearest_marks(self, marks: SurfacePoints) -> IntArray:
        """Return for each vertex the mark nearest to it along the edges of the mesh, shape (N,).

        A mark is joined to the three corners of its face; so the answer stays on the sheet, at the price of path
        lengths that are a little too long.
        """
        n, p = self.mesh.n_vertices, len(marks.faces)
        a, b = half_edges(self.mesh.faces)
        corner = self.mesh.faces[marks.faces]
        where = marks.interpolate(self.mesh, self.mesh.vertices)
        to_corner = np.linalg.norm(self.mesh.vertices[corner] - where[:, None], axis=2).ravel()
        length = np.linalg.norm(self.mesh.vertices[a] - self.mesh.vertices[b], axis=1)
        rows = np.concatenate([a, n + np.repeat(np.arange(p), 3)])
        columns = np.concatenate([b, corner.ravel()])
        weight = np.maximum(np.concatenate([length, to_corner]), 1e-300)
        order = np.unique(rows * (n + p) + columns, return_index=True)[1]
        graph = coo_array((weight[order], (rows[order], columns[order])), shape=(n + p, n + p)).tocsr()
        sources = dijkstra(graph, directed=False, indices=np.arange(n, n + p), min_only=True, return_predecessors=True)[
            2
        ]
        return np.asarray(sources[:n] - n, dtype=np.int64)


def nearest_on_triangles(points: FloatArray, triangles: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Nearest point of triangle p to point p, for P pairs.

    Parameters
    ----------
    points
        Shape (P, 3).
    triangles
        Shape (P, 3 corners, 3 coordinates); a degenerate triangle is treated as its edges.

    Returns
    -------
    Barycentric weights, shape (P, 3), and squared distances, shape (P,).
    """
    weights = _plane_weights(points, triangles)
    outside = np.flatnonzero(~(weights.min(axis=1) >= 0))
    weights[outside] = _edge_weights(points[outside], triangles[outside])
    offset = np.einsum("pk,pkc->pc", weights, triangles) - points
    return weights, _dot(offset, offset)


def _plane_weights(points: FloatArray, triangles: FloatArray) -> FloatArray:
    """Barycentric weights of the foot in the triangle's plane; some are negative, or NaN, if it lies outside."""
    e1, e2 = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    p = points - triangles[:, 0]
    d11, d12, d22, p1, p2 = (_dot(x, y) for x, y in ((e1, e1), (e1, e2), (e2, e2), (p, e1), (p, e2)))
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1.0 / (d11 * d22 - d12 * d12)
        u, v = (d22 * p1 - d12 * p2) * inverse, (d11 * p2 - d12 * p1) * inverse
        return np.column_stack([1.0 - u - v, u, v])


def _edge_weights(points: FloatArray, triangles: FloatArray) -> FloatArray:
    """Barycentric weights of the nearest point of the triangle's three edges."""
    weights, best = np.zeros((len(points), 3)), np.full(len(points), np.inf)
    for k in range(3):
        edge, offset = triangles[:, (k + 1) % 3] - triangles[:, k], points - triangles[:, k]
        t = np.clip(_dot(offset, edge) / np.maximum(_dot(edge, edge), 1e-300), 0.0, 1.0)
        offset = offset - t[:, None] * edge
        distance = _dot(offset, offset)
        nearer = distance < best
        best[nearer], weights[nearer] = distance[nearer], 0.0
        weights[nearer, k], weights[nearer, (k + 1) % 3] = 1.0 - t[nearer], t[nearer]
    return weights


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    product: FloatArray = np.einsum("pc,pc->p", a, b)
    return product
