"""A coarse mesh of a big one, with linear interpolation between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import dijkstra

from csm._types import IntArray
from csm.mesh.shape import Mesh
from csm.mesh.surface import Surface
from csm.mesh.topology import edge_graph

AT_MOST = 50_000
"""Vertices that a coarse mesh should have at most."""

_POINTS = 50_000  # that are looked for at once; more take memory and no less time


@dataclass(frozen=True, eq=False)
class Coarse:
    """Some vertices of a mesh, spread evenly over its edges, from which functions are interpolated to all of them.

    Attributes
    ----------
    seeds
        Shape (C,): the vertices.
    interpolation
        Shape (N, C), with at most three entries in a row, not negative and of sum 1.
    """

    seeds: IntArray
    interpolation: sparse.csr_array


def coarsen(mesh: Mesh, at_most: int = AT_MOST) -> Coarse:
    """Return a coarse mesh with about a tenth of the vertices, or fewer if that is more than `at_most`.

    The seeds are a maximal set in which no two are joined by two edges or fewer (by three, four and so on for smaller
    sets).  Every vertex belongs to the seed that is nearest along the edges; where three cells meet, their seeds are a
    face of the coarse mesh.  A vertex is interpolated from the point of that mesh that is nearest to it on its own
    sheet, so that fingers that touch stay apart.

    Parameters
    ----------
    mesh
        Any triangle mesh without unreferenced vertices.  Each component has at least one seed.
    at_most
        How many seeds are wanted at most; a mesh with more components has more.

    Examples
    --------
    >>> from csm import load_humans
    >>> coarse = coarsen(load_humans()[0])
    >>> coarse.interpolation.shape
    (6899, 663)
    """
    graph = edge_graph(mesh.vertices, mesh.faces)
    seeds, reach = spread_out(graph, 2), 2
    while len(seeds) > at_most and reach < 16:
        reach += 1
        seeds = spread_out(graph, reach)
    return Coarse(seeds, _interpolation(mesh, seeds, cells(graph, seeds)[0]))


def spread_out(graph: sparse.csr_array, reach: int) -> IntArray:
    """Return a maximal set of vertices of a graph no two of which are within `reach` edges of each other.

    Examples
    --------
    >>> path = sparse.csr_array(sparse.diags_array([np.ones(8), np.ones(8)], offsets=[-1, 1]))
    >>> np.diff(spread_out(path, 2)) > 2
    array([ True,  True])
    """
    n = graph.shape[0]
    ring = sparse.csr_array(graph + sparse.eye_array(n))
    priority = np.random.default_rng(0).permutation(n) + 1
    seeds = np.zeros(n, dtype=bool)
    open_ = np.ones(n, dtype=bool)
    while open_.any():
        chosen = open_ & (_spread(ring, np.where(open_, priority, 0), reach) == priority)
        seeds |= chosen
        open_ &= _spread(ring, chosen.astype(np.int64), reach) == 0
    return np.flatnonzero(seeds)


def _spread(ring: sparse.csr_array, values: IntArray, reach: int) -> IntArray:
    """Return the greatest value within `reach` edges of every vertex."""
    for _ in range(reach):
        values = np.maximum.reduceat(values[ring.indices], ring.indptr[:-1])
    return values


def cells(graph: sparse.csr_array, seeds: IntArray, *, unweighted: bool = False) -> tuple[IntArray, IntArray]:
    """Return for each vertex of a graph the number of its nearest seed, and the vertex before it on the way from there.

    Shape (N,) each; before a seed there is none, which is negative.  The way is along the edges, and each counts as one
    where it is `unweighted`.

    Examples
    --------
    >>> path = sparse.csr_array(sparse.diags_array([np.ones(4), np.ones(4)], offsets=[-1, 1]))
    >>> cell, before = cells(path, np.array([0, 4]))
    >>> cell[[0, 1, 3, 4]], before[[1, 3]]
    (array([0, 0, 1, 1]), array([0, 4]))
    """
    _, before, nearest = dijkstra(graph, unweighted=unweighted, indices=seeds, min_only=True, return_predecessors=True)
    number = np.full(graph.shape[0], -1)
    number[seeds] = np.arange(len(seeds))
    return number[nearest], before.astype(np.int64)


def _interpolation(mesh: Mesh, seeds: IntArray, cell: IntArray) -> sparse.csr_array:
    n = mesh.n_vertices
    meeting = cell[mesh.faces]
    meeting = meeting[(meeting != np.roll(meeting, 1, axis=1)).all(axis=1)]
    faces = meeting[np.unique(np.sort(meeting, axis=1), axis=0, return_index=True)[1]]
    surface = Surface(Mesh(mesh.vertices[seeds], faces, f"{mesh.name}, coarse"))
    rows, columns, weights = np.arange(n)[:, None].repeat(3, axis=1), cell[:, None].repeat(3, axis=1), np.zeros((n, 3))
    weights[:, 0] = 1.0  # a component with fewer than three cells has no coarse face: it takes its seed's value
    incidence = surface.incidence
    lies = np.flatnonzero(np.diff(incidence.indptr)[cell] > 0)
    for some in np.array_split(lies, len(lies) // _POINTS + 1):
        found = surface.walk(mesh.vertices[some], incidence.indices[incidence.indptr[cell[some]]].astype(np.int64))
        columns[some], weights[some] = faces[found.faces], found.barycentric
    made = sparse.coo_array((weights.ravel(), (rows.ravel(), columns.ravel())), shape=(n, len(seeds))).tocsr()
    made.eliminate_zeros()
    return made
