"""A mesh whose edges are split, flipped and collapsed while its vertices stay on a given surface, for remeshing."""

from __future__ import annotations

import numpy as np

from csm._types import BoolArray, FloatArray, IntArray
from csm.mesh.remesh import edge_moves
from csm.mesh.remesh.edge_moves import EdgeTable
from csm.mesh.shape import Mesh
from csm.mesh.surface import Surface, SurfacePoints, nearest_on_triangles

KEEP_NORMAL = 0.5
"""Least cosine between a face's normals before and after a flip, and across an edge that may be flipped."""

LONG = 4 / 3
"""Relative length above which `remesh` splits an edge; a collapse makes none longer."""

LOSS = 0.2
"""Relative distance up to which a vanishing vertex may come to lie from the new faces; keeps finger tips and ears."""

CORNER = 0.7
"""Boundary vertices where the boundary turns by more than acos(0.7), about 45 degrees, never move or vanish."""


class EditableMesh:
    """Vertices on a surface and faces between them, with the operations that change both.

    Parameters
    ----------
    mesh
        The surface to stay on, and the mesh to begin with.
    sizes
        Wanted edge length at each vertex of `mesh` up to a common factor, shape (N,).
    n_fixed
        The first `n_fixed` vertices neither move nor vanish.
    rng
        Source of all random choices.
    """

    def __init__(self, mesh: Mesh, sizes: FloatArray, n_fixed: int, rng: np.random.Generator) -> None:
        self.surface, self.sizes, self.n_fixed, self.rng = Surface(mesh), sizes, n_fixed, rng
        self.vertices, self.faces = mesh.vertices.copy(), mesh.faces.copy()
        self.place = self.surface.at_vertices()

    @property
    def n(self) -> int:
        """Number of vertices now."""
        return len(self.vertices)

    def table(self) -> EdgeTable:
        """Return the edges as they are now."""
        return edge_moves.edge_table(self.faces)

    def wanted(self) -> FloatArray:
        """Wanted edge length at each vertex, shape (n,)."""
        return self.place.interpolate(self.surface.mesh, self.sizes)

    def relative_lengths(self, table: EdgeTable) -> FloatArray:
        """Edge lengths divided by the wanted ones, shape (E,)."""
        length = np.linalg.norm(self.vertices[table.ends[:, 0]] - self.vertices[table.ends[:, 1]], axis=1)
        ratio: FloatArray = length / self.wanted()[table.ends].mean(axis=1)
        return ratio

    def split_longest(self, count: int, longer_than: float) -> int:
        """Split up to `count` independent edges, longest first, that exceed a relative length; returns how many."""
        table = self.table()
        ratio = self.relative_lengths(table) * self.rng.uniform(0.97, 1.03, len(table.ends))
        chosen = edge_moves.independent(
            table, np.flatnonzero(ratio > longer_than), ratio[ratio > longer_than], len(self.faces)
        )
        chosen = chosen[:count]
        t = self.rng.uniform(0.4, 0.6, (len(chosen), 1))
        points = (1 - t) * self.vertices[table.ends[chosen, 0]] + t * self.vertices[table.ends[chosen, 1]]
        place = self.surface.walk(points, self.place.faces[table.ends[chosen, 0]])
        self.faces = edge_moves.split(self.faces, table, chosen, self.n)
        self.place = SurfacePoints(
            np.concatenate([self.place.faces, place.faces]), np.concatenate([self.place.barycentric, place.barycentric])
        )
        landed = place.interpolate(self.surface.mesh, self.surface.mesh.vertices)
        self.vertices = np.concatenate([self.vertices, landed])
        return len(chosen)

    def flip(self, rounds: int = 8) -> None:
        """Flip edges towards Delaunay (opposite angles of at most pi together), but not over ridges."""
        for _ in range(rounds):
            table = self.table()
            candidates = np.flatnonzero(table.inner)
            gain = self._flip_gain(table, candidates)
            candidates, gain = candidates[gain > 1e-3], gain[gain > 1e-3]
            chosen = edge_moves.independent(table, candidates, gain, len(self.faces))
            after = edge_moves.flip(self.faces, table, chosen)
            if (after == self.faces).all():
                break
            self.faces = after

    def _flip_gain(self, table: EdgeTable, edges: IntArray) -> FloatArray:
        """By how much the opposite angles exceed pi; -1 where a flip would turn a face or cut a ridge."""
        (a, b), (c, d) = (
            (self.vertices[i] for i in table.ends[edges].T),
            (self.vertices[i] for i in table.opposite[edges].T),
        )
        before = _normals(a, b, c), _normals(b, a, d)
        after = _normals(c, d, b), _normals(d, c, a)
        cosines = [(m * n).sum(axis=1) for m in before for n in after] + [(before[0] * before[1]).sum(axis=1)]
        allowed = np.min(cosines, axis=0) > KEEP_NORMAL
        return np.where(allowed, _angles(c, a, b) + _angles(d, a, b) - np.pi, -1.0)

    def collapse_shortest(self, count: int, shorter_than: float, careful: bool = True) -> int:
        """Collapse up to `count` independent edges below a relative length, shortest first; returns how many.

        Unless told not to be careful, it makes no long edge and cuts off no tip or rim.
        """
        table = self.table()
        ratio = self.relative_lengths(table)
        edges = np.flatnonzero(ratio < shorter_than)
        edges = edges[edge_moves.collapsible(table, edges, self.n)]
        gone, kept = self._directions(table, edges)
        fine = (gone >= self.n_fixed) & ~(self.stuck(table)[gone])
        edges, gone, kept = edges[fine], gone[fine], kept[fine]
        fine = self._collapse_is_fine(gone, kept, careful)
        edges, gone, kept = edges[fine], gone[fine], kept[fine]
        chosen = edge_moves.independent_collapses(table, gone, kept, -ratio[edges], self.n)
        chosen = chosen[np.argsort(ratio[edges[chosen]], kind="stable")][:count]
        self.faces = edge_moves.collapse(self.faces, gone[chosen], kept[chosen])
        self._drop(gone[chosen])
        return len(chosen)

    def _directions(self, table: EdgeTable, edges: IntArray) -> tuple[IntArray, IntArray]:
        """Choose which end vanishes: never a corner, or a boundary vertex into the inside; otherwise at random."""
        rank = 2 * self.stuck(table).astype(int) + edge_moves.boundary_vertices(table, self.n)
        i, j = table.ends[edges].T
        i_goes = rank[i] * 2 + self.rng.integers(0, 2, len(edges)) < rank[j] * 2 + 1
        return np.where(i_goes, i, j), np.where(i_goes, j, i)

    def stuck(self, table: EdgeTable) -> BoolArray:
        """Which vertices are corners of the boundary, shape (n,)."""
        rim = ~table.inner
        total = np.zeros((self.n, 3))
        forward = np.where((table.faces[rim, 0] >= 0)[:, None], table.ends[rim], table.ends[rim, ::-1])
        step = self.vertices[forward[:, 1]] - self.vertices[forward[:, 0]]
        step /= np.maximum(np.linalg.norm(step, axis=1), 1e-300)[:, None]
        incoming, outgoing = total.copy(), total
        incoming[forward[:, 1]], outgoing[forward[:, 0]] = step, step
        turns: BoolArray = (incoming * outgoing).sum(axis=1) < CORNER
        return edge_moves.boundary_vertices(table, self.n) & turns

    def _collapse_is_fine(self, gone: IntArray, kept: IntArray, careful: bool) -> BoolArray:
        """Whether moving `gone[k]` onto `kept[k]` turns no face too far, and is careful, shape (K,)."""
        order = np.argsort(self.faces.ravel(), kind="stable")
        begin = np.searchsorted(self.faces.ravel()[order], np.arange(self.n + 1))
        count = begin[gone + 1] - begin[gone]
        owner = np.repeat(np.arange(len(gone)), count)
        offset = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)
        face = self.faces[order[np.repeat(begin[gone], count) + offset] // 3]
        stays = ~(face == kept[owner][:, None]).any(axis=1)
        face, owner = face[stays], owner[stays]
        after = np.where(face == gone[owner][:, None], kept[owner][:, None], face)
        before_n, after_n = (_normals(*(self.vertices[f[:, k]] for k in range(3))) for f in (face, after))
        bad = (before_n * after_n).sum(axis=1) < KEEP_NORMAL
        fine: BoolArray = np.bincount(owner[bad], minlength=len(gone)) == 0
        if not careful:
            return fine
        reach, loss = np.zeros(len(gone)), np.full(len(gone), np.inf)
        edges = self.vertices[after] - self.vertices[kept[owner]][:, None]
        np.maximum.at(reach, owner, np.linalg.norm(edges, axis=2).max(axis=1))
        np.minimum.at(loss, owner, nearest_on_triangles(self.vertices[gone[owner]], self.vertices[after])[1])
        fine &= (reach <= LONG * self.wanted()[kept]) & (np.sqrt(loss) <= LOSS * self.wanted()[gone])
        return fine

    def _drop(self, gone: IntArray) -> None:
        keep = np.ones(self.n, dtype=bool)
        keep[gone] = False
        number = np.cumsum(keep) - 1
        self.vertices, self.faces = self.vertices[keep], number[self.faces]
        self.place = self.place[keep]

    def relax(self, step: float = 0.7) -> None:
        """Move free inner vertices towards the weighted mean of the faces around them, along the surface."""
        corners = self.vertices[self.faces]
        cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        weight = np.linalg.norm(cross, axis=1) / self.wanted()[self.faces].mean(axis=1) ** 4
        total, centre, normal = np.zeros(self.n), np.zeros((self.n, 3)), np.zeros((self.n, 3))
        for k in range(3):
            np.add.at(total, self.faces[:, k], weight)
            np.add.at(centre, self.faces[:, k], weight[:, None] * corners.mean(axis=1))
            np.add.at(normal, self.faces[:, k], cross)
        move = step * (centre / np.maximum(total, 1e-300)[:, None] - self.vertices)
        normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
        self.move(move - (move * normal).sum(axis=1)[:, None] * normal)

    def scatter(self, amount: float) -> None:
        """Move free inner vertices at random by up to `amount` of the wanted edge length."""
        self.move(self.rng.uniform(-1, 1, (self.n, 3)) * (amount * self.wanted())[:, None])

    def move(self, offset: FloatArray) -> None:
        """Move free inner vertices by offsets (n, 3) and back onto the surface.

        Moves that turn a face, or that end on the other side of a thin part, are undone.
        """
        free = ~edge_moves.boundary_vertices(self.table(), self.n)
        free[: self.n_fixed] = False
        moved = np.flatnonzero(free)
        place = self.surface.walk(self.vertices[moved] + offset[moved], self.place.faces[moved])
        landed = place.interpolate(self.surface.mesh, self.surface.mesh.vertices)
        crosses = self.surface.mesh.face_crosses
        same_side = (crosses[place.faces] * crosses[self.place.faces[moved]]).sum(axis=1) >= 0
        accept = free.copy()
        accept[moved] = same_side
        before = _normals(*(self.vertices[self.faces[:, k]] for k in range(3)))
        for _ in range(20):
            trial = self.vertices.copy()
            trial[accept] = landed[accept[moved]]
            turned = (before * _normals(*(trial[self.faces[:, k]] for k in range(3)))).sum(axis=1) < KEEP_NORMAL
            if not (turned[:, None] & accept[self.faces]).any():
                break
            accept[self.faces[turned]] = False
        self.vertices = trial
        self.place.faces[accept], self.place.barycentric[accept] = (
            place.faces[accept[moved]],
            place.barycentric[accept[moved]],
        )


def _normals(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    n = np.cross(b - a, c - a)
    unit: FloatArray = n / np.maximum(np.linalg.norm(n, axis=1), 1e-300)[:, None]
    return unit


def _angles(apex: FloatArray, a: FloatArray, b: FloatArray) -> FloatArray:
    u, v = a - apex, b - apex
    angles: FloatArray = np.arctan2(np.linalg.norm(np.cross(u, v), axis=1), (u * v).sum(axis=1))
    return angles
