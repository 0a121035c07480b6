"""Nearest points of triangles in Q dimensions, from squared distances between points alone.

A point of a triangle with shares w_i of its corners is at the squared distance
sum_i w_i d_i^2 - sum_{i<j} w_i w_j e_ij^2 from a point that is at distances d_i from the corners, where e_ij are the
lengths of the edges (Stewart's theorem, in any dimension).  So all that is needed of Q dimensions is one product of
matrices for the distances to the vertices.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from csm._types import BoolArray, FloatArray, IntArray

_BLOCK = 2**21  # distances at a time
_PAIRS = 2**19  # query-vertex pairs at a time: each has about six faces
_ROWS = 4096  # queries of a tree at a time
_FEW_DIMENSIONS = 6  # up to which a tree is faster than all distances
_SIDES = ((0, 1), (1, 2), (2, 0))


class OnTriangles(NamedTuple):
    """Points on triangles: the face, shape (P,), the corners' shares, shape (P, 3), and the squared distance."""

    faces: IntArray
    weights: FloatArray
    squared: FloatArray


class _Tree(NamedTuple):
    points: cKDTree
    vertices: IntArray
    reach: float  # the greatest squared radius of a face at one of them


def on_triangles(corner: FloatArray, side: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the corners' shares, (P, 3), of the nearest points of P triangles, and the squared distances, (P,).

    Parameters
    ----------
    corner
        Shape (P, 3): squared distances to the corners 0, 1, 2.
    side
        Shape (P, 3): squared lengths of the sides 01, 12, 20.
    """
    best, weights = _inside(corner, side)
    for k, (i, j) in enumerate(_SIDES):
        length = side[:, k]
        along = np.divide(corner[:, i] + length - corner[:, j], 2 * length, out=np.zeros_like(length), where=length > 0)
        t = np.clip(along, 0.0, 1.0)
        squared = (1 - t) * corner[:, i] + t * corner[:, j] - t * (1 - t) * length
        better = squared < best
        best[better] = squared[better]
        weights[better] = 0.0
        weights[better, i], weights[better, j] = 1 - t[better], t[better]
    return weights, np.maximum(best, 0.0)


def _inside(corner: FloatArray, side: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the squared distance, infinite where the foot of the perpendicular is outside, and the foot's shares."""
    a, b, mixed = side[:, 0], side[:, 2], 0.5 * (side[:, 0] + side[:, 2] - side[:, 1])
    along_a, along_b = 0.5 * (corner[:, 0] + a - corner[:, 1]), 0.5 * (corner[:, 0] + b - corner[:, 2])
    area = a * b - mixed**2
    proper = area > 1e-14 * side.max(1, initial=0.0) ** 2  # a flatter triangle is as good as its sides
    area = np.where(proper, area, 1.0)
    second, third = (along_a * b - along_b * mixed) / area, (along_b * a - along_a * mixed) / area
    weights = np.stack([1 - second - third, second, third], axis=1)
    products = sum(weights[:, i] * weights[:, j] * side[:, k] for k, (i, j) in enumerate(_SIDES))
    squared = (weights * corner).sum(1) - products
    inside = proper & (weights >= 0).all(1)
    return np.where(inside, squared, np.inf), weights


def nearest_triangles(queries: FloatArray, vertices: FloatArray, faces: IntArray) -> OnTriangles:
    """Return the nearest points of a mesh, see `csm.matching.barycentric.nearest_on_faces`."""
    search = _Search(queries, vertices, faces)
    rows = _ROWS if search.trees else max(1, _BLOCK // len(vertices))
    found = [search.block(np.arange(i, min(i + rows, len(queries)))) for i in range(0, len(queries), rows)]
    chosen = np.concatenate([np.empty(0, dtype=np.int64), *found])
    weights, squared = search.measured(np.arange(len(queries)), chosen)
    return OnTriangles(chosen, weights, squared)


class _Search:
    def __init__(self, queries: FloatArray, vertices: FloatArray, faces: IntArray) -> None:
        centre = vertices[faces].mean((0, 1))
        self.queries, self.vertices, self.faces = queries - centre, vertices - centre, faces
        ends = ((self.vertices[faces[:, i]], self.vertices[faces[:, j]]) for i, j in _SIDES)
        self.sides = np.stack([((p - q) ** 2).sum(1) for p, q in ends], axis=1)
        self.radius = _ball(self.sides)
        corners = faces.ravel(), np.repeat(np.arange(len(faces)), 3)
        fans = sparse.csr_matrix((np.ones(faces.size), corners), shape=(len(vertices), len(faces)))
        self.first, self.fan = fans.indptr.astype(np.int64), fans.indices.astype(np.int64)
        self.reach = np.full(len(vertices), -np.inf)  # of a vertex: the greatest radius of its faces
        np.maximum.at(self.reach, faces.ravel(), np.repeat(self.radius, 3))
        used = np.isfinite(self.reach)
        self.vertices[~used] = 0.0  # they may be anywhere, or nowhere
        self.norms = np.where(used, (self.vertices**2).sum(1), np.inf)
        self.trees = self._planted(used) if queries.shape[1] <= _FEW_DIMENSIONS else []
        largest = float(self.norms[used].max())
        self.rounding = 32 * np.finfo(float).eps * (largest + (self.queries**2).sum(1))

    def _planted(self, used: BoolArray) -> list[_Tree]:
        """Return trees of vertices of much the same reach, so that one large face makes no search of others wide."""
        level = np.zeros(len(used), dtype=np.int64)
        largest = float(self.reach[used].max(initial=0.0))
        small = used & (self.reach < largest)
        level[small] = np.minimum(np.log2(largest / np.maximum(self.reach[small], largest * 2.0**-40)), 40) // 4
        members = [np.flatnonzero(used & (level == number)) for number in np.unique(level[used])]
        return [_Tree(cKDTree(self.vertices[m]), m, float(self.reach[m].max(initial=0.0))) for m in members]

    def block(self, rows: IntArray) -> IntArray:
        """Return the nearest face of each of these queries."""
        found = self._near(rows) if self.trees else self._near_by_products(rows)
        if found is None or (len(found[0]) > _PAIRS and len(rows) > 1):
            half = len(rows) // 2
            return np.concatenate([self.block(rows[:half]), self.block(rows[half:])])
        of, vertex = found
        count = self.first[vertex + 1] - self.first[vertex]
        before = np.repeat(np.cumsum(count) - count, count)
        face = self.fan[np.repeat(self.first[vertex], count) + np.arange(count.sum()) - before]
        of = np.repeat(of, count)
        order = np.unique(of * len(self.faces) + face)
        return self._best(rows, order // len(self.faces), order % len(self.faces))

    def _near_by_products(self, rows: IntArray) -> tuple[IntArray, IntArray]:
        """Return pairs of a query (its place in `rows`) and a vertex that has a face which may be the nearest."""
        squared = self.norms - 2 * (self.queries[rows] @ self.vertices.T)
        limit = squared.min(1) + self.rounding[rows]
        of, vertex = np.nonzero(squared - self.reach <= limit[:, None])
        return of, vertex

    def _near(self, rows: IntArray) -> tuple[IntArray, IntArray] | None:
        """Do the same with trees, in few dimensions; None if there would be too many pairs."""
        points = self.queries[rows]
        away = np.stack([np.asarray(tree.points.query(points)[0]) for tree in self.trees])
        limit = away.min(0) ** 2 + self.rounding[rows]
        radii = [np.sqrt(limit + tree.reach) for tree in self.trees]
        counts = [
            tree.points.query_ball_point(points, radius, return_length=True)
            for tree, radius in zip(self.trees, radii, strict=True)
        ]
        if np.sum(counts) > _PAIRS and len(rows) > 1:
            return None
        pairs = []
        for tree, radius, count in zip(self.trees, radii, counts, strict=True):
            inside = np.flatnonzero(count)
            balls = tree.points.query_ball_point(points[inside], radius[inside])
            numbers = np.concatenate([np.empty(0, dtype=np.int64), *(np.asarray(b, dtype=np.int64) for b in balls)])
            pairs.append((np.repeat(inside, count[inside]), tree.vertices[numbers]))
        of, vertex = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
        near = ((points[of] - self.vertices[vertex]) ** 2).sum(1) - self.reach[vertex] <= limit[of]
        return of[near], vertex[near]

    def _best(self, rows: IntArray, of: IntArray, face: IntArray) -> IntArray:
        """Return for each query the nearest of its faces; pairs are sorted, and every query has one."""
        begins = np.searchsorted(of, np.arange(len(rows)))
        squared = self.measured(rows[of], face)[1]
        limit = np.minimum.reduceat(squared, begins) + self.rounding[rows]
        return np.minimum.reduceat(np.where(squared <= limit[of], face, len(self.faces)), begins)

    def measured(self, query: IntArray, face: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return shares, (P, 3), and squared distances, (P,), of P pairs of a query and a face."""
        weights, squared, step = np.empty((len(face), 3)), np.empty(len(face)), max(1, _BLOCK // self.queries.shape[1])
        for begin in range(0, len(face), step):
            here = slice(begin, begin + step)
            points, corners = self.queries[query[here]], self.faces[face[here]]
            to_corners = [((points - self.vertices[corners[:, i]]) ** 2).sum(1) for i in range(3)]
            weights[here], squared[here] = on_triangles(np.stack(to_corners, axis=1), self.sides[face[here]])
        return weights, squared


def _ball(sides: FloatArray) -> FloatArray:
    """Return the squared radius of the smallest ball around each triangle of these squared sides."""
    a, b, c = np.sort(sides, axis=1).T
    doubled = 2 * (a * b + b * c + c * a) - a**2 - b**2 - c**2  # 16 times the squared area
    around = np.divide(a * b * c, doubled, out=np.full_like(a, np.inf), where=doubled > 0)
    squared: FloatArray = np.where(c >= a + b, c / 4, np.minimum(around, c / 3)) * (1 + 1e-9)
    return squared
