"""Close the mouth and the eye sockets of the template: cut the cavities off and triangulate their rims."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def close_cavities(vertices: Floats, faces: Ints, cavity: NDArray[np.bool_], mirror: Ints) -> Ints:
    """Return the faces without those marked in `cavity`, their rims filled symmetrically; vertex numbers stay.

    Parameters
    ----------
    vertices
        Positions of the symmetric template, shape (N, 3), metres.
    faces
        Shape (M, 3), counter-clockwise from outside.
    cavity
        True for the faces to cut off, shape (M,).
    mirror
        Vertex i's mirror image, shape (N,).
    """
    patches = [faces[~cavity]]
    for rim in boundary_loops(faces[cavity]):
        on_midline = [k for k, v in enumerate(rim) if mirror[v] == v]
        if len(on_midline) == 2:
            first, second = on_midline
            half = rim[first : second + 1]
            patch = fill(vertices, half)
            patches += [patch, mirror[patch][:, ::-1]]
        elif vertices[rim, 0].min() > 0:
            patch = fill(vertices, rim)
            patches += [patch, mirror[patch][:, ::-1]]
    return np.concatenate(patches)


def boundary_loops(faces: Ints) -> list[list[int]]:
    """Return the closed boundary loops of a patch, in the direction of its faces."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).tolist()
    both = {tuple(e) for e in edges}
    following = {a: b for a, b in edges if (b, a) not in both}
    loops = []
    while following:
        loop = [min(following)]
        while (after := following.pop(loop[-1])) != loop[0]:
            loop.append(after)
        loops.append(loop)
    return loops


def fill(vertices: Floats, loop: list[int]) -> Ints:
    """Triangulate a loop with the least sum of squared edge lengths (dynamic programme), shape (n - 2, 3)."""
    p = vertices[loop]
    n = len(loop)
    square = ((p[:, None] - p[None]) ** 2).sum(2)
    best = np.zeros((n, n))
    split = np.zeros((n, n), int)
    for gap in range(2, n):
        for i in range(n - gap):
            j = i + gap
            middle = np.arange(i + 1, j)
            cost = best[i, middle] + best[middle, j] + square[i, middle] + square[middle, j] + square[i, j]
            split[i, j] = middle[cost.argmin()]
            best[i, j] = cost.min()
    triangles, todo = [], [(0, n - 1)]
    while todo:
        i, j = todo.pop()
        if j - i < 2:
            continue
        k = int(split[i, j])
        triangles.append((loop[i], loop[k], loop[j]))
        todo += [(i, k), (k, j)]
    return np.array(triangles, dtype=np.int64)
