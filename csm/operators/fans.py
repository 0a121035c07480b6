"""The fan of faces around every vertex, and the directions in which its edges leave."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from csm._types import BoolArray, FloatArray, IntArray
from csm.mesh.shape import Mesh


@dataclass(frozen=True, eq=False)
class Fans:
    """Corners by vertex, and the directed edges that leave each vertex.

    Corner 3 f + s is that of face f at its vertex number s.

    Attributes
    ----------
    corners
        Shape (N, V): the corners at each vertex, then -1, for at most V faces at a vertex.
    following, preceding
        Shape (3 M,): the other two vertices of the corner's face, the next and the one before as the face runs.
    tails, heads
        Shape (E,): the edges of one fan per vertex, each once.
    lengths
        Shape (E,).
    directions
        Shape (E,), in radians, counter-clockwise from the longest edge of the tail.  In all, they are 2 pi where the
        faces close up, and the sum of the faces' angles at a boundary.
    """

    corners: IntArray
    following: IntArray
    preceding: IntArray
    tails: IntArray
    heads: IntArray
    lengths: FloatArray
    directions: FloatArray


def fans(mesh: Mesh) -> Fans:
    """Return the fans of a consistently oriented mesh; where faces at a vertex form several fans, one of them."""
    n = mesh.n_vertices
    vertex, following, preceding = (mesh.faces[:, turn].ravel() for turn in ([0, 1, 2], [1, 2, 0], [2, 0, 1]))
    angle = _corner_angles(mesh)
    next_corner = _matches(vertex * n + preceding, vertex * n + following)
    open_start = _matches(vertex * n + following, vertex * n + preceding) < 0
    start = np.full(n, -1)
    start[vertex[::-1]] = np.arange(3 * mesh.n_faces)[::-1]
    start[vertex[open_start][::-1]] = np.flatnonzero(open_start)[::-1]
    walk = _walk(start, next_corner, angle)
    ends = np.flatnonzero((walk.last >= 0) & ~walk.closes)
    tails = np.concatenate([vertex[walk.corners], ends])
    heads = np.concatenate([following[walk.corners], preceding[walk.last[ends]]])
    directions = np.concatenate([walk.directions, walk.turned[ends]])
    directions *= np.where(walk.closes, 2 * np.pi / np.where(walk.turned > 0, walk.turned, 1.0), 1.0)[tails]
    lengths = np.linalg.norm(mesh.vertices[heads] - mesh.vertices[tails], axis=1)
    order = np.lexsort((lengths, tails))
    reference = np.zeros(n)
    reference[tails[order]] = directions[order]  # of several, the last one, the longest, stays
    return Fans(_by_vertex(vertex, n), following, preceding, tails, heads, lengths, directions - reference[tails])


def _corner_angles(mesh: Mesh) -> FloatArray:
    """Return the angle of every corner, (3 M,)."""
    p = mesh.corners
    ahead, back = (p[:, [1, 2, 0]] - p).reshape(-1, 3), (p[:, [2, 0, 1]] - p).reshape(-1, 3)
    cross = np.linalg.norm(np.cross(ahead, back), axis=1)
    angles: FloatArray = np.arctan2(cross, np.einsum("ij,ij->i", ahead, back))
    return angles


def _matches(wanted: IntArray, keys: IntArray) -> IntArray:
    """Return for each wanted key the first place in `keys` that has it, or -1."""
    order = np.argsort(keys, kind="stable")
    at = np.minimum(np.searchsorted(keys[order], wanted), len(keys) - 1)
    return np.where(keys[order[at]] == wanted, order[at], -1)


class _Walk(NamedTuple):
    """The corners that were passed, (C,), and how far the walk had turned before each; by vertex, (N,), how it ended.

    `last` corner (-1 where there is none), angle `turned` in all, and whether the fan `closes`.
    """

    corners: IntArray
    directions: FloatArray
    last: IntArray
    turned: FloatArray
    closes: BoolArray


def _walk(start: IntArray, next_corner: IntArray, angle: FloatArray) -> _Walk:
    """Go around every vertex from its starting corner, (N,), at the same time."""
    here, turned = start.copy(), np.zeros(len(start))
    last, closes = np.full(len(start), -1), np.zeros(len(start), dtype=bool)
    corners, directions = [], []
    for _ in range(len(angle)):
        going = np.flatnonzero(here >= 0)
        if going.size == 0:
            break
        at = here[going]
        corners.append(at)
        directions.append(turned[going])
        turned[going] += angle[at]
        last[going] = at
        here[going] = next_corner[at]
        back = here == start
        closes |= back & (start >= 0)
        here[back] = -1
    return _Walk(np.concatenate(corners), np.concatenate(directions), last, turned, closes)


def _by_vertex(vertex: IntArray, n: int) -> IntArray:
    order = np.argsort(vertex, kind="stable")
    counts = np.bincount(vertex, minlength=n)
    table = np.full((n, max(int(counts.max()), 1)), -1)
    rank = np.arange(len(vertex)) - np.repeat(np.cumsum(counts) - counts, counts)
    table[vertex[order], rank] = order
    return table
