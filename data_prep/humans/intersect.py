"""Smooth away small places where a mesh cuts through itself."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from csm.mesh.intersections import intersecting_pairs

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def untangle(vertices: Floats, faces: Ints, rounds: int = 60) -> Floats:
    """Smooth the surroundings of intersecting triangles until none are left or `rounds` have passed.

    Each round moves the vertices of the offending triangles halfway, and their neighbours a quarter, towards the mean
    of their own neighbours; creases of skinning (groin, armpit) and touching toes come apart, all else stays untouched.
    """
    x = vertices.copy()
    n = len(x)
    i, j = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).T
    link = csr_array((np.ones(len(i)), (i, j)), shape=(n, n))
    link = ((link + link.T) > 0).astype(float)
    degree = link.sum(axis=1)
    for _ in range(rounds):
        pairs = intersecting_pairs(x, faces)
        if not len(pairs):
            break
        core = np.zeros(n)
        core[faces[pairs]] = 1.0
        step = np.maximum(0.5 * core, 0.25 * ((link @ core) > 0))
        x += step[:, None] * ((link @ x) / degree[:, None] - x)
    return x
