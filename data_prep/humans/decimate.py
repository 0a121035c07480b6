"""Symmetric edge collapse of one connectivity under many shapes at once; the vertices that stay are a subset."""

from __future__ import annotations

import heapq

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

TANGENTIAL = 0.03
"""Weight of squared edge length beside squared distance to the surface: flat dense regions thin out evenly."""
MAX_VALENCE = 9
MIN_QUALITY = 0.25


class Decimation:
    """Half-edge collapses in mirrored pairs, cheapest first by quadrics summed over shapes (Garland and Heckbert 1997).

    Parameters
    ----------
    shapes
        The same vertices in S poses and persons, shape (S, N, 3), metres.
    faces
        Shape (M, 3): closed, manifold, equal to its own mirror image.
    mirror
        Vertex i's mirror image, shape (N,).
    """

    def __init__(self, shapes: Floats, faces: Ints, mirror: Ints) -> None:
        self.shapes, self.mirror = shapes, mirror
        self.faces: dict[int, tuple[int, int, int]] = {k: tuple(f) for k, f in enumerate(faces.tolist())}
        self.around: dict[int, set[int]] = {}
        for k, face in self.faces.items():
            for v in face:
                self.around.setdefault(v, set()).add(k)
        self.weight, self.moment, self.matrix, self.offset = self._quadrics(faces)
        self.stamp = np.zeros(shapes.shape[1], int)
        self.heap: list[tuple[float, int, int, int]] = []

    def _quadrics(self, faces: Ints) -> tuple[Floats, Floats, Floats, Floats]:
        """Per shape and vertex: area sum and, of the planes around it, sum a nn', sum a d n, sum a d^2 (d = n.x)."""
        s, n = self.shapes.shape[:2]
        p = self.shapes[:, faces]
        cross = np.cross(p[:, :, 1] - p[:, :, 0], p[:, :, 2] - p[:, :, 0])
        double = np.linalg.norm(cross, axis=2)
        normal = cross / np.maximum(double, 1e-15)[..., None]
        area = double / 6
        d = (normal * p[:, :, 0]).sum(2)
        weight, moment = np.zeros((s, n)), np.zeros((s, n))
        matrix, offset = np.zeros((s, n, 3, 3)), np.zeros((s, n, 3))
        for k in range(3):
            rows = (slice(None), faces[:, k])
            np.add.at(weight, rows, area)
            np.add.at(moment, rows, area * d * d)
            np.add.at(offset, rows, (area * d)[..., None] * normal)
            np.add.at(matrix, rows, area[..., None, None] * normal[..., None] * normal[..., None, :])
        return weight, moment, matrix, offset

    def neighbours(self, v: int) -> set[int]:
        """Vertices that share a face with v."""
        return {w for k in self.around[v] for w in self.faces[k]} - {v}

    def cost(self, u: int, v: int) -> float:
        """Cost of moving u onto v, averaged over the shapes (area times squared length)."""
        x = self.shapes[:, v]
        plane = (
            np.einsum("si,sij,sj->s", x, self.matrix[:, u], x) - 2 * (x * self.offset[:, u]).sum(1) + self.moment[:, u]
        )
        length = ((x - self.shapes[:, u]) ** 2).sum(1)
        return float((np.maximum(plane, 0) + TANGENTIAL * self.weight[:, u] * length).mean())

    def push(self, u: int) -> None:
        """Put the collapses of u onto each neighbour on the heap; a vertex of the midline stays on it."""
        on_midline = self.mirror[u] == u
        for v in self.neighbours(u):
            if v != self.mirror[u] and (not on_midline or self.mirror[v] == v):
                heapq.heappush(self.heap, (self.cost(u, v), u, v, int(self.stamp[u])))

    def collapsed(self, u: int, v: int) -> list[tuple[int, int, int]] | None:
        """Return the faces that moving u onto v leaves around u, or None if topology or shape forbid it."""
        ring, other = self.neighbours(u), self.neighbours(v)
        if len(ring & other) != 2 or len(ring | other) - 4 > MAX_VALENCE or len(ring | other) < 6:
            return None
        if any(len(self.around[w]) <= 4 for w in ring & other):
            return None
        kept = [self.faces[k] for k in sorted(self.around[u]) if v not in self.faces[k]]
        after = [tuple(v if w == u else w for w in face) for face in kept]
        old, new = self.shapes[:, np.array(kept)], self.shapes[:, np.array(after)]
        n_old, n_new = (np.cross(p[:, :, 1] - p[:, :, 0], p[:, :, 2] - p[:, :, 0]) for p in (old, new))
        cosine = (n_old * n_new).sum(2) / (np.linalg.norm(n_old, axis=2) * np.linalg.norm(n_new, axis=2) + 1e-30)
        if cosine.min() < 0.1 or np.median(cosine, axis=0).min() < 0.5:
            return None
        q = np.median(quality(new), axis=0).min()
        return after if q > min(MIN_QUALITY, np.median(quality(old), axis=0).min()) else None

    def collapse(self, u: int, v: int, after: list[tuple[int, int, int]]) -> None:
        """Move u onto v."""
        kept = [k for k in sorted(self.around[u]) if v not in self.faces[k]]
        for k in self.around.pop(u) - set(kept):
            for w in set(self.faces.pop(k)) - {u}:
                self.around[w].discard(k)
        for k, face in zip(kept, after, strict=True):
            self.faces[k] = face
            self.around[v].add(k)
        for total in (self.weight, self.moment, self.matrix, self.offset):
            total[:, v] += total[:, u]

    def run(self, n_vertices: int) -> None:
        """Collapse until at most `n_vertices` are left."""
        for u in sorted(self.around):
            self.push(u)
        while len(self.around) > n_vertices and self.heap:
            _, u, v, stamp = heapq.heappop(self.heap)
            if u not in self.around or v not in self.around or stamp != self.stamp[u]:
                continue
            self._collapse_pair(u, v)

    def _collapse_pair(self, u: int, v: int) -> None:
        mu, mv = int(self.mirror[u]), int(self.mirror[v])
        near = self.neighbours(u) | self.neighbours(v)
        if mu != u and mu in near:
            return
        after = self.collapsed(u, v)
        if after is None or (mu != u and self.collapsed(mu, mv) is None):
            return
        before = {w: set(self.around[w]) for w in near | {u, v}}, {k: self.faces[k] for k in self.around[u]}
        self.collapse(u, v, after)
        if mu != u:
            mirrored = self.collapsed(mu, mv)
            if mirrored is None:
                self._undo(u, v, *before)
                return
            self.collapse(mu, mv, mirrored)
        touched = near | {int(self.mirror[w]) for w in near}
        for w in sorted(touched & self.around.keys()):
            self.stamp[w] += 1
            self.push(w)

    def _undo(self, u: int, v: int, around: dict[int, set[int]], faces: dict[int, tuple[int, int, int]]) -> None:
        self.around.update(around)
        self.faces.update(faces)
        for total in (self.weight, self.moment, self.matrix, self.offset):
            total[:, v] -= total[:, u]


def quality(p: Floats) -> Floats:
    """4 sqrt(3) area / sum of squared edges of triangles (..., 3, 3): 1 if equilateral, 0 if degenerate."""
    a, b, c = p[..., 0, :], p[..., 1, :], p[..., 2, :]
    double = np.linalg.norm(np.cross(b - a, c - a), axis=-1)
    squares = ((b - a) ** 2).sum(-1) + ((c - b) ** 2).sum(-1) + ((a - c) ** 2).sum(-1)
    return 2 * np.sqrt(3) * double / np.maximum(squares, 1e-30)
