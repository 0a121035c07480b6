"""Which pairs of a collection are matched: all of a small one, a connected sparse graph of a large one."""

from __future__ import annotations

import numpy as np
from numpy.random import default_rng
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from csm._types import FloatArray, IntArray
from csm.errors import ConfigError


def pairs_of(distances: FloatArray, near: int, far: int) -> IntArray:
    """Return the edges of a connected graph: every shape with its nearest ones, and with some at random.

    Near shapes are matched most reliably; random ones close cycles across the collection.  Parts that are not joined
    so far are joined where they are nearest to each other.  Random is the same at each call.

    Parameters
    ----------
    distances
        Shape (n, n), symmetric: how unlike the shapes are.
    near, far
        How many nearest shapes, and how many others at random, each shape is matched with at least.

    Returns
    -------
    IntArray
        Shape (E, 2), in order; the first of each pair is the smaller number.

    Raises
    ------
    ConfigError
        If there are fewer than two shapes, or a number is below 0.

    Examples
    --------
    >>> pairs_of(np.abs(np.subtract.outer(np.arange(4.0), np.arange(4.0))), 1, 0)
    array([[0, 1],
           [1, 2],
           [2, 3]])
    """
    n = len(distances)
    if n < 2 or near < 0 or far < 0:
        raise ConfigError(f"a graph of {n} shapes, {near} near and {far} others each: wanted 2 shapes and 0 or more")
    rng = default_rng(0)
    joined = np.zeros((n, n), dtype=bool)
    for i in range(n):
        others = np.argsort(distances[i], kind="stable")
        others = others[others != i]
        joined[i, others[:near]] = True
        rest = others[near:]
        joined[i, rng.permutation(rest)[:far]] = True
    joined |= joined.T
    while (parts := connected_components(coo_matrix(joined))[1]).max() > 0:
        apart = np.where(parts[:, None] != parts[None, :], distances, np.inf)
        at = np.unravel_index(int(apart.argmin()), apart.shape)
        joined[at] = joined[at[::-1]] = True
    return np.argwhere(np.triu(joined))


def triangles_of(pairs: IntArray, n: int) -> IntArray:
    """Return the triangles of a graph, shape (T, 3): the numbers of the edges ij, jk and ik with i < j < k.

    Examples
    --------
    >>> triangles_of(np.array([[0, 1], [0, 2], [1, 2], [2, 3]]), 4)
    array([[0, 2, 1]])
    """
    number = np.full((n, n), -1)
    number[pairs[:, 0], pairs[:, 1]] = np.arange(len(pairs))
    edges, thirds = np.nonzero((number[pairs[:, 0]] >= 0) & (number[pairs[:, 1]] >= 0))
    i, j = pairs[edges].T
    return np.stack([edges, number[j, thirds], number[i, thirds]], axis=1).reshape(-1, 3)
