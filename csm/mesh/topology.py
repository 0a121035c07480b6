"""Edges of a triangle mesh, from its faces alone: half-edges, edges in one and in both directions, components.

All of them take faces as they come, also open and non-manifold ones.  A face that names a vertex twice has an edge from
that vertex to itself.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components

from csm._types import FloatArray, IntArray


class HalfEdges(NamedTuple):
    """The sides of M faces as the faces run: `tails` and `heads`, shape (3 M,); number 3 f + s is side s of face f."""

    tails: IntArray
    heads: IntArray


class DirectedEdges(NamedTuple):
    """Every edge in both directions, sorted by target, then source: `targets` and `sources`, shape (E,) each."""

    targets: IntArray
    sources: IntArray


def half_edges(faces: IntArray) -> HalfEdges:
    """Return the 3 M half-edges of faces, shape (M, 3)."""
    return HalfEdges(faces.ravel(), faces[:, [1, 2, 0]].ravel())


def edge_keys(tails: IntArray, heads: IntArray, n: int) -> IntArray:
    """Return a number for each pair of vertices, the same in both directions: low n + high, for n vertices."""
    return np.minimum(tails, heads) * n + np.maximum(tails, heads)


def directed_edges(faces: IntArray, n: int) -> DirectedEdges:
    """Return the edges of faces, shape (M, 3), among `n` vertices in both directions, each once."""
    tails, heads = half_edges(faces)
    keys = np.unique(np.concatenate([tails * n + heads, heads * n + tails]))
    return DirectedEdges(keys // n, keys % n)


def edge_graph(vertices: FloatArray, faces: IntArray) -> csr_array:
    """Return the symmetric matrix, (N, N), of the edges' lengths, in the unit of `vertices`.

    Edges from a vertex to itself are left out.
    """
    n = len(vertices)
    low, high = np.divmod(np.unique(edge_keys(*half_edges(faces), n)), n)
    low, high = low[low != high], high[low != high]
    lengths = np.linalg.norm(vertices[low] - vertices[high], axis=1)
    # A stored zero would vanish from the graph, so coincident neighbours get the smallest positive length instead.
    lengths = np.maximum(lengths, np.finfo(np.float64).tiny)
    both = np.concatenate([low, high]), np.concatenate([high, low])
    return coo_array((np.tile(lengths, 2), both), shape=(n, n)).tocsr()


def components(tails: IntArray, heads: IntArray, n: int) -> IntArray:
    """Return the number of the connected component of each of `n` nodes, shape (n,), which edges (E,) join.

    Components are numbered from 0 in the order of their first nodes.
    """
    ones = np.ones(len(tails), dtype=np.int8)
    graph = coo_array((ones, (tails, heads)), shape=(n, n))
    return connected_components(graph, directed=False)[1].astype(np.int64)


def rim(vertices: FloatArray, faces: IntArray) -> float:
    """Return the total length of the boundary, in the unit of `vertices`; 0 for a closed surface."""
    tails, heads = half_edges(faces)
    keys, first, uses = np.unique(edge_keys(tails, heads, len(vertices)), return_index=True, return_counts=True)
    border = first[(uses == 1) & (keys % (len(vertices) + 1) != 0)]
    return float(np.linalg.norm(vertices[heads[border]] - vertices[tails[border]], axis=1).sum())
