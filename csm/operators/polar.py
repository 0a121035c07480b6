"""Geodesic polar coordinates: how far from a vertex the vertices around it are, and in which direction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import dijkstra

from csm._types import BoolArray, FloatArray, IntArray
from csm.mesh.shape import Mesh
from csm.mesh.topology import edge_graph
from csm.operators._edges import dot
from csm.operators.fans import Fans, fans

_BLOCK = 256  # centres at a time
_GAIN = 1e-6  # least part of a distance by which a shorter one replaces it
_MARGIN = 1.2  # times the limit is how far fronts go: a vertex may be seen past one that is farther away
_DETOUR = 1.5  # paths along edges are at most so much longer than the limit where a vertex is looked at


class PolarDiscs(NamedTuple):
    """The discs of N centres, one after the other, each without its centre.

    Shapes: disc i has the entries from `indptr[i]`, (N + 1,), up to `indptr[i + 1]`; per entry, ascending within a
    disc, `vertices` (P,), `radii` (P,) in the unit of the mesh and `angles` (P,) in [0, 2 pi).
    """

    indptr: IntArray
    vertices: IntArray
    radii: FloatArray
    angles: FloatArray


def polar_discs(mesh: Mesh, limit: float) -> PolarDiscs:
    """Return the geodesic polar coordinates around every vertex of all vertices within `limit`, and of its neighbours.

    The directions of the edges at a centre are the angles between them, scaled to 2 pi in all where the faces close up.
    From there coordinates spread over the faces, nearest vertices first, and again from where they get shorter.  Of a
    face with two known corners, the plane is unfolded until the known distances meet in one point, which is where the
    third corner is seen from; its direction lies between the two known ones as its line of sight does.  Where that line
    leaves the face, the way is along an edge.  On a plane, distances and directions are exact.

    Angles increase counter-clockwise, seen from outside, from the centre's longest edge.

    Parameters
    ----------
    mesh
        N vertices; boundaries are fine.  Where faces meet in more than one fan at a centre, one fan counts.
    limit
        Distance, in the unit of the mesh.

    References
    ----------
    Melvaer, Reimers, "Geodesic polar coordinates on polygonal meshes", CGF 2012.
    """
    around, graph = fans(mesh), edge_graph(mesh.vertices, mesh.faces)
    starts = range(0, mesh.n_vertices, _BLOCK)
    blocks = [np.arange(start, min(start + _BLOCK, mesh.n_vertices)) for start in starts]
    parts = [_block(mesh, around, graph, centres, limit) for centres in blocks]
    counts = np.concatenate([np.diff(part.indptr) for part in parts])
    columns = (np.concatenate([part[i] for part in parts]) for i in (1, 2, 3))
    return PolarDiscs(np.concatenate([[0], np.cumsum(counts)]), *columns)


def _block(mesh: Mesh, around: Fans, graph: sparse.csr_array, centres: IntArray, limit: float) -> PolarDiscs:
    front = _Front.around(around, graph, centres, limit)
    while (nearest := front.close(_MARGIN * limit)) is not None:
        front.spread(mesh, around, *nearest)
    kept = (front.radii <= limit) | front.neighbour
    kept[np.arange(len(centres)), front.slots[np.arange(len(centres)), centres]] = False
    indptr = np.concatenate([[0], np.cumsum(kept.sum(axis=1))])
    return PolarDiscs(indptr, front.vertices[kept], front.radii[kept], np.mod(front.angles[kept], 2 * np.pi))


@dataclass(eq=False)
class _Front:
    """Fronts that spread from S centres at the same time, each over at most W vertices of its own.

    Attributes
    ----------
    centres
        Shape (S,).
    vertices
        Shape (S, W): the vertices that each front may reach, ascending; then -1.
    slots
        Shape (S, N): where a vertex is in its row of `vertices`; W, which no vertex has, if it is not there.
    radii, angles
        Shape (S, W): coordinates found so far.
    closed
        Shape (S, W): whether they have been carried on to the neighbours.
    neighbour
        Shape (S, W): whether an edge joins it with the centre.
    """

    centres: IntArray
    vertices: IntArray
    slots: IntArray
    radii: FloatArray
    angles: FloatArray
    closed: BoolArray
    neighbour: BoolArray

    @classmethod
    def around(cls, around: Fans, graph: sparse.csr_array, centres: IntArray, limit: float) -> _Front:
        """Start at the centres with their neighbours at the ends of their edges."""
        near = np.isfinite(dijkstra(graph, indices=centres, limit=_DETOUR * limit))
        row, edge = np.nonzero(around.tails == centres[:, None])
        near[row, around.heads[edge]] = True
        rows, columns = np.nonzero(near)
        width = int(near.sum(axis=1).max())
        place = near.cumsum(axis=1) - 1
        slots = np.where(near, place, width)
        shape = len(centres), width
        vertices, radii, angles = np.full(shape, -1), np.full(shape, np.inf), np.zeros(shape)
        vertices[rows, place[rows, columns]] = columns
        closed, neighbour = vertices < 0, np.zeros(shape, dtype=bool)
        at = row, slots[row, around.heads[edge]]
        radii[at], angles[at], neighbour[at] = around.lengths[edge], around.directions[edge], True
        own = np.arange(len(centres)), slots[np.arange(len(centres)), centres]
        radii[own], closed[own] = 0.0, True
        return cls(centres, vertices, slots, radii, angles, closed, neighbour)

    def close(self, limit: float) -> tuple[IntArray, IntArray] | None:
        """Take the nearest open vertex of each front; return fronts and vertices, or None if all are farther."""
        open_radii = np.where(self.closed, np.inf, self.radii)
        slot = open_radii.argmin(axis=1)
        rows = np.flatnonzero(open_radii[np.arange(len(slot)), slot] <= limit)
        self.closed[rows, slot[rows]] = True
        return (rows, self.vertices[rows, slot[rows]]) if rows.size else None

    def spread(self, mesh: Mesh, around: Fans, rows: IntArray, vertices: IntArray) -> None:
        """Carry the coordinates of one vertex per front on to the other corners of its faces."""
        which, column = np.nonzero(around.corners[vertices] >= 0)
        corner, row, here = around.corners[vertices[which], column], rows[which], vertices[which]
        a, b = around.following[corner], around.preceding[corner]
        row, here = np.tile(row, 2), np.tile(here, 2)
        known, target = np.concatenate([a, b]), np.concatenate([b, a])
        slot = self.slots[row, target]
        within = (slot < self.vertices.shape[1]) & (target != self.centres[row])
        row, here, known, target, slot = (x[within] for x in (row, here, known, target, slot))
        radii, angles = self._seen(mesh, row, here, known, target)
        nearer = radii < (1 - _GAIN) * self.radii[row, slot]
        order = np.flatnonzero(nearer)[np.argsort(-radii[nearer], kind="stable")]  # of several, the last one stays
        self.radii[row[order], slot[order]] = radii[order]
        self.angles[row[order], slot[order]] = angles[order]
        self.closed[row[order], slot[order]] = False

    def _seen(
        self, mesh: Mesh, row: IntArray, here: IntArray, known: IntArray, target: IntArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the coordinates of targets, from faces with the corners `here` and `known`, or from `here` alone."""
        points = mesh.vertices
        at, beside = self.slots[row, here], self.slots[row, known]
        r, theta = self.radii[row, at], self.angles[row, at]
        step = points[target] - points[here]
        radii, angles = r + np.linalg.norm(step, axis=1), theta.copy()
        usable = (beside < self.vertices.shape[1]) & (known != self.centres[row])
        usable[usable] = self.closed[row[usable], beside[usable]]
        both = np.flatnonzero(usable)
        other_r, other_theta = self.radii[row[both], beside[both]], self.angles[row[both], beside[both]]
        span = points[known[both]] - points[here[both]]
        sight = line_of_sight(r[both], other_r, span, step[both])
        through = sight.share >= 0
        found = both[through]
        chord = np.linalg.norm(points[target[found]] - points[self.centres[row[found]]], axis=1)
        turn = np.angle(np.exp(1j * (other_theta - theta[both])))[through]
        radii[found] = np.maximum(sight.radii[through], chord)
        angles[found] = theta[found] + sight.share[through] * turn
        return radii, angles


class Sight(NamedTuple):
    """Distances (E,), and the share (E,) of the angle between two directions; -1 where the line leaves the face."""

    radii: FloatArray
    share: FloatArray


def line_of_sight(r: FloatArray, other_r: FloatArray, span: FloatArray, step: FloatArray) -> Sight:
    """See the third corner of E faces from the point whose distances from the first two are `r` and `other_r`, (E,).

    The point lies in the plane of the face, beyond the edge `span`, (E, 3), from the first to the second corner;
    `step`, (E, 3), goes from the first to the third.
    """
    length = np.linalg.norm(span, axis=1)
    length = np.where(length > 0, length, 1.0)
    x0 = (r**2 - other_r**2 + length**2) / (2 * length)
    y0 = np.sqrt(np.maximum(r**2 - x0**2, 0.0))
    x = dot(step, span) / length
    y = -np.sqrt(np.maximum(dot(step, step) - x**2, 0.0))
    height = y0 - y
    crossing = x0 + (x - x0) * y0 / np.where(height > 0, height, 1.0)
    inside = (height > 0) & (y0 > 0) & (crossing >= 0) & (crossing <= length)
    first, second, third = (np.arctan2(x0 - across, y0 - down) for across, down in ((0.0, 0.0), (length, 0.0), (x, y)))
    between = np.where(inside & (first > second), first - second, 1.0)
    share = np.clip((first - third) / between, 0.0, 1.0)
    return Sight(np.hypot(x - x0, height), np.where(inside, share, -1.0))
