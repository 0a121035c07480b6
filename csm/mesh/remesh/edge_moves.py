"""Edge tables and independent edge splits, flips and collapses: the moves that a remesher is made of.

Every function is pure: arrays in, new arrays out.  A move is applied to many edges at once, so the edges given must be
independent; `independent` and `independent_collapses` choose such a set by priority.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from csm._types import BoolArray, FloatArray, IntArray
from csm.mesh.topology import edge_keys


@dataclass(frozen=True, eq=False)
class EdgeTable:
    """The undirected edges of a manifold, oriented triangle mesh.

    Parameters
    ----------
    ends
        Shape (E, 2), smaller vertex first, sorted.
    faces
        Shape (E, 2): the face that runs from `ends[:, 0]` to `ends[:, 1]`, and the one that runs back; -1 for none.
    opposite
        Shape (E, 2): the third vertex of these two faces; -1 for none.
    """

    ends: IntArray
    faces: IntArray
    opposite: IntArray

    @property
    def inner(self) -> BoolArray:
        """Which edges have two faces, shape (E,)."""
        return np.asarray((self.faces >= 0).all(axis=1))

    def of_faces(self, n_faces: int) -> IntArray:
        """Numbers of the three edges of each face, shape (n_faces, 3), in no particular order."""
        rows, columns = np.nonzero(self.faces >= 0)
        order = np.argsort(self.faces[rows, columns], kind="stable")
        return rows[order].reshape(n_faces, 3)


def edge_table(faces: IntArray) -> EdgeTable:
    """Return the edges of manifold, oriented faces, shape (M, 3)."""
    n = int(faces.max()) + 1
    a, b, c = (np.concatenate([faces[:, (k + s) % 3] for k in range(3)]) for s in range(3))
    backwards = (a > b).astype(np.int64)
    keys, number = np.unique(edge_keys(a, b, n), return_inverse=True)
    table = EdgeTable(np.column_stack([keys // n, keys % n]), np.full((len(keys), 2), -1), np.full((len(keys), 2), -1))
    table.faces[number, backwards] = np.tile(np.arange(len(faces)), 3)
    table.opposite[number, backwards] = c
    return table


def independent(table: EdgeTable, candidates: IntArray, priority: FloatArray, n_faces: int) -> IntArray:
    """Choose candidate edges of which no two share a face: those that come first among the edges of both their faces.

    `priority` (one value per candidate) decides, the highest first; the result is sorted that way.
    """
    order = candidates[np.argsort(-priority, kind="stable")]
    rank = np.full(len(table.ends), len(order))
    rank[order] = np.arange(len(order))
    best = np.append(rank[table.of_faces(n_faces)].min(axis=1), len(order))
    chosen = (rank[order][:, None] <= best[table.faces[order]]).all(axis=1)
    return order[chosen]


def split(faces: IntArray, table: EdgeTable, edges: IntArray, first_vertex: int) -> IntArray:
    """Split independent edges; edge `edges[k]` gets the new vertex `first_vertex + k`.  Returns the new faces."""
    result, added = faces.copy(), []
    for side in range(2):
        hit = table.faces[edges, side] >= 0
        face, apex = table.faces[edges[hit], side], table.opposite[edges[hit], side]
        middle = first_vertex + np.flatnonzero(hit)
        start, end = table.ends[edges[hit], side], table.ends[edges[hit], 1 - side]
        result[face] = np.column_stack([start, middle, apex])
        added.append(np.column_stack([middle, end, apex]))
    return np.concatenate([result, *added])


def flip(faces: IntArray, table: EdgeTable, edges: IntArray) -> IntArray:
    """Flip independent inner edges whose new edge does not exist yet; of edges with the same new edge the first."""
    n = int(faces.max()) + 1
    crossing = edge_keys(table.opposite[edges, 0], table.opposite[edges, 1], n)
    first = np.zeros(len(edges), dtype=bool)
    first[np.unique(crossing, return_index=True)[1]] = True
    edges = edges[first & ~np.isin(crossing, table.ends[:, 0] * n + table.ends[:, 1])]
    (a, b), (c, d) = table.ends[edges].T, table.opposite[edges].T
    result = faces.copy()
    result[table.faces[edges, 0]] = np.column_stack([c, d, b])
    result[table.faces[edges, 1]] = np.column_stack([d, c, a])
    return result


def adjacency(table: EdgeTable, n: int) -> csr_array:
    """Symmetric vertex adjacency with entries 1, shape (n, n)."""
    i, j = table.ends.T
    both = (np.concatenate([i, j]), np.concatenate([j, i]))
    return csr_array((np.ones(2 * len(i)), both), shape=(n, n))


def collapsible(table: EdgeTable, edges: IntArray, n: int) -> BoolArray:
    """Which edges can be collapsed without changing the topology (the link condition), shape (len(edges),).

    The ends must have as many common neighbours as the edge has faces, each of them with more than three
    neighbours (two on the boundary), and an inner edge must not join two boundary vertices.
    """
    link = adjacency(table, n)
    i, j = table.ends[edges].T
    common = link[i].multiply(link[j]).sum(axis=1)
    n_faces = (table.faces[edges] >= 0).sum(axis=1)
    rim = boundary_vertices(table, n)
    spare = (np.diff(link.indptr) > np.where(rim, 2, 3))[table.opposite[edges]] | (table.opposite[edges] < 0)
    linked: BoolArray = (common == n_faces) & spare.all(axis=1) & ((n_faces == 1) | ~(rim[i] & rim[j]))
    return linked


def boundary_vertices(table: EdgeTable, n: int) -> BoolArray:
    """Which of n vertices lie on the boundary, shape (n,)."""
    rim = np.zeros(n, dtype=bool)
    rim[table.ends[~table.inner]] = True
    return rim


def independent_collapses(table: EdgeTable, gone: IntArray, kept: IntArray, priority: FloatArray, n: int) -> IntArray:
    """Choose collapses `gone[k]` -> `kept[k]` that do not disturb each other, highest priority first where they do.

    Two collapses are independent if neither end of one lies in the closed neighbourhood of the other's vanishing
    vertex: then each changes no face and no neighbourhood on which the other's link condition rests.  Returns positions
    in `gone`.
    """
    link = adjacency(table, n)
    rank = np.empty(len(gone), dtype=np.int64)
    rank[np.argsort(-priority, kind="stable")] = np.arange(len(gone))
    free, chosen = np.ones(len(gone), dtype=bool), np.zeros(len(gone), dtype=bool)
    for _ in range(4):
        at_gone, at_ends = np.full(n, len(gone)), np.full(n, len(gone))
        np.minimum.at(at_gone, gone[free], rank[free])
        np.minimum.at(at_ends, gone[free], rank[free])
        np.minimum.at(at_ends, kept[free], rank[free])
        claimed, near = _least_around(table, at_gone), _least_around(table, at_ends)
        chosen |= free & (rank <= claimed[gone]) & (rank <= claimed[kept]) & (rank <= near[gone])
        vanishing, ends = np.zeros(n), np.zeros(n)
        vanishing[gone[chosen]], ends[gone[chosen]], ends[kept[chosen]] = 1, 1, 1
        taken, crowded = vanishing + link @ vanishing > 0, ends + link @ ends > 0
        free &= ~(taken[gone] | taken[kept] | crowded[gone])
    return np.flatnonzero(chosen)


def _least_around(table: EdgeTable, values: IntArray) -> IntArray:
    """Least value over each vertex and its neighbours."""
    least = values.copy()
    for side in range(2):
        np.minimum.at(least, table.ends[:, side], values[table.ends[:, 1 - side]])
    return least


def collapse(faces: IntArray, gone: IntArray, kept: IntArray) -> IntArray:
    """Move each vertex `gone[k]` onto `kept[k]` and drop the faces that vanish; vertex numbers stay."""
    target = np.arange(int(faces.max()) + 1)
    target[gone] = kept
    moved: IntArray = target[faces]
    alive = (moved[:, 0] != moved[:, 1]) & (moved[:, 1] != moved[:, 2]) & (moved[:, 2] != moved[:, 0])
    return np.compress(alive, moved, axis=0)
