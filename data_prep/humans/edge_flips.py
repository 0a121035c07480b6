"""Flips of edges towards a Delaunay triangulation: one connectivity for many shapes at once, in mirrored pairs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Face = tuple[int, int, int]

MARGIN = 0.1
"""How far (radians) the two opposite angles of an edge must exceed pi, in the median over the shapes, for a flip."""
MIN_COSINE = 0.8
"""Least cosine between the two triangles of an edge, in the median over the shapes: ridges and creases are kept."""


def flip_towards_delaunay(shapes: Floats, faces: Ints, mirror: Ints, rounds: int = 10) -> Ints:
    """Return the faces after flipping what improves the triangles in most shapes; symmetric faces stay symmetric.

    Parameters
    ----------
    shapes
        Shape (S, N, 3), metres.
    faces
        Shape (M, 3), closed and equal to its own mirror image.
    mirror
        Vertex i's mirror image, shape (N,).
    """
    mesh = [(int(a), int(b), int(c)) for a, b, c in faces]
    for _ in range(rounds):
        opposite = {(f[k], f[(k + 1) % 3]): (f[(k + 2) % 3], n) for n, f in enumerate(mesh) for k in range(3)}
        done: set[int] = set()
        edges = set(opposite)
        for a, b in sorted(e for e in opposite if e[0] < e[1]):
            pair = {tuple(sorted(e)) for e in ((a, b), (int(mirror[a]), int(mirror[b])))}
            touched = {opposite[e][1] for x, y in pair for e in ((x, y), (y, x))}
            crossing = {tuple(sorted((opposite[x, y][0], opposite[y, x][0]))) for x, y in pair}
            if done & touched or len(touched) != 2 * len(pair) or len(crossing) != len(pair):
                continue
            if any(e in edges for e in crossing) or not all(worth(shapes, x, y, opposite) for x, y in pair):
                continue
            for x, y in pair:
                (c, first), (d, second) = opposite[x, y], opposite[y, x]
                mesh[first], mesh[second] = (c, d, y), (d, c, x)
                edges |= {(c, d), (d, c)}
            done |= touched
        if not done:
            break
    return np.array(mesh, dtype=np.int64)


def worth(shapes: Floats, a: int, b: int, opposite: dict[tuple[int, int], tuple[int, int]]) -> bool:
    """Whether flipping the edge (a, b) brings the connectivity closer to Delaunay without harm to the surface."""
    c, d = opposite[a, b][0], opposite[b, a][0]
    p = {v: shapes[:, v] for v in (a, b, c, d)}
    if np.median(angle(p[c], p[a], p[b]) + angle(p[d], p[a], p[b])) < np.pi + MARGIN:
        return False
    before = normal(p[a], p[b], p[c]), normal(p[b], p[a], p[d])
    after = normal(p[c], p[d], p[b]), normal(p[d], p[c], p[a])
    cosines = np.stack([(m * n).sum(1) for m in before for n in after] + [(before[0] * before[1]).sum(1)])
    return bool(np.median(cosines, axis=1).min() > MIN_COSINE and cosines.min() > 0)


def angle(apex: Floats, p: Floats, q: Floats) -> Floats:
    """Angle at the apex between p and q in radians, shape (S,)."""
    u, v = p - apex, q - apex
    return np.arctan2(np.linalg.norm(np.cross(u, v), axis=1), (u * v).sum(1))


def normal(p: Floats, q: Floats, r: Floats) -> Floats:
    """Unit normals of the triangles p, q, r, shape (S, 3)."""
    n = np.cross(q - p, r - p)
    return n / np.maximum(np.linalg.norm(n, axis=1), 1e-30)[:, None]
