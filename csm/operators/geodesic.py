"""Geodesic distances on one mesh: exact, by heat, or along edges; whole rows or only the pairs that are asked for.

Distances are in the unit of `mesh.vertices`.  No method ever holds an N x N matrix.
"""

from __future__ import annotations

import itertools
from typing import Literal, Protocol, TypeAlias, get_args

import numpy as np
import potpourri3d
from pygeodesic.geodesic import PyGeodesicAlgorithmExact
from scipy.sparse.csgraph import dijkstra

from csm._places import shown
from csm._types import BoolArray, FloatArray, IntArray
from csm.errors import ConfigError, MeshError
from csm.mesh.check import check
from csm.mesh.inputs import MeshLike, as_mesh
from csm.mesh.shape import Mesh
from csm.mesh.topology import components, edge_graph, half_edges
from csm.operators._pairs import PairPlan, plan_pairs

Method: TypeAlias = Literal["exact", "heat", "edge"]

EXACT_VERSION = 2
"""Raised where exact distances change, so that what was kept of them is computed anew."""


class Geodesics(Protocol):
    """Distances on one mesh; infinite between vertices that no path joins."""

    @property
    def method(self) -> str:
        """Which approximation the numbers are: "exact", "heat" or "edge"."""

    def rows(self, sources: IntArray) -> FloatArray:
        """Return distances from each of S sources to all vertices, shape (S, N)."""

    def pairs(self, sources: IntArray, targets: IntArray) -> FloatArray:
        """Return the distance from ``sources[i]`` to ``targets[i]``, shape (P,), without computing whole rows."""

    def diameter(self, max_rows: int = 8) -> float:
        """Estimate the largest distance between two vertices of the largest component, from below.

        Sweeps from a vertex to the one farthest from it as long as the distance grows.  Then goes on where it could be
        larger still: from a row at s with largest entry e(s), no vertex v has a distance above ``d(s, v) + e(s)``.

        A lower bound of the diameter, and at least half of it.  Measured with 8 rows, edge-graph distances and three
        starts on bodies and animals of FAUST, SCAPE and TOSCA: at least 0.998 of the largest of all N x N distances
        (plain double sweeps: 0.983); on shapes like a ball with bumps it was 0.90 at worst.

        Parameters
        ----------
        max_rows
            Rows computed at most.
        """


def geodesics(mesh: MeshLike, method: Method = "exact") -> Geodesics:
    """Prepare distances on a mesh.

    Parameters
    ----------
    mesh
        N vertices, in any way that `csm.mesh.inputs.as_mesh` takes.  A vertex of no face is infinitely far from all
        others.
    method
        "exact": the polyhedral metric, by window propagation (Mitchell, Mount, Papadimitriou, SIAM J. Comput. 16, 1987;
        Surazhsky et al., SIGGRAPH 2005) in pygeodesic; propagation stops at the last target, so a pair a few edges
        apart costs about 0.1 ms and a whole row at 7,000 vertices about 0.1 s.
        "heat": Crane, Weischedel, Wardetzky, ACM TOG 32, 2013, in potpourri3d; off by 2 % on average and 5 % nearby;
        not quite symmetric.
        "edge": shortest paths along edges (Dijkstra), never shorter than exact, about 5 % longer at any resolution.

    Raises
    ------
    ConfigError
        If the method is unknown.
    MeshError
        If the mesh has no faces, or (exact only) is not a manifold or has an edge of no length.
    """
    kinds: dict[str, type[_OnMesh]] = {"exact": _Exact, "heat": _Heat, "edge": _Edge}
    if not isinstance(method, str) or method not in kinds:
        raise ConfigError(f"geodesic method {shown(method)} is unknown: choose one of {', '.join(get_args(Method))}")
    return kinds[method](as_mesh(mesh))


class _OnMesh:
    """Base of the methods: unused vertices are left out, and distances between components are infinite."""

    method: str
    symmetric = True

    def __init__(self, mesh: Mesh) -> None:
        if mesh.n_faces == 0:
            raise MeshError(f"{mesh.label}: geodesic distances need faces, but the mesh has none")
        self.mesh = mesh
        self.used, faces = np.unique(mesh.faces, return_inverse=True)
        self.vertices = mesh.vertices[self.used]
        self.faces: IntArray = faces.reshape(-1, 3).astype(np.int64)
        self.local = np.full(mesh.n_vertices, -1)
        self.local[self.used] = np.arange(len(self.used))
        self.graph = edge_graph(self.vertices, self.faces)
        self.component = components(*half_edges(self.faces), len(self.used))
        self._prepare()

    def __repr__(self) -> str:
        return f"Geodesics({self.mesh!r}, {self.method})"

    def rows(self, sources: IntArray) -> FloatArray:
        sources = self._checked(sources)
        out = np.full((len(sources), self.mesh.n_vertices), np.inf)
        for row, source in zip(out, sources, strict=True):
            row[source] = 0.0
            at = self.local[source]
            if at >= 0:
                reached = np.flatnonzero(self.component == self.component[at])
                row[self.used[reached]] = self._reach(at, reached)
        return out

    def pairs(self, sources: IntArray, targets: IntArray) -> FloatArray:
        sources, targets = self._checked(sources), self._checked(targets)
        if sources.shape != targets.shape:
            raise ConfigError(f"{self.mesh.label}: {len(sources)} sources but {len(targets)} targets: they go in pairs")
        out = np.where(sources == targets, 0.0, np.inf)
        joined = self._joined(sources, targets)
        plan = plan_pairs(self.vertices, self.local[sources[joined]], self.local[targets[joined]], self.symmetric)
        out[joined] = self._run(plan)
        return out

    def diameter(self, max_rows: int = 8) -> float:
        largest = np.flatnonzero(self.component == np.bincount(self.component).argmax())
        here, longest = largest[0], 0.0
        bound = np.full(len(largest), np.inf)
        for _ in range(max_rows):
            row = self._reach(here, largest)
            reach = float(row.max())
            bound = np.minimum(bound, row + reach)
            here = largest[(row if reach > longest else bound).argmax()]
            longest = max(longest, reach)
            if bound.max() <= longest:
                break
        return longest

    def _run(self, plan: PairPlan) -> FloatArray:
        parts = itertools.pairwise(plan.starts)
        found = [
            self._reach(source, plan.targets[start:stop])
            for source, (start, stop) in zip(plan.sources, parts, strict=True)
        ]
        return np.concatenate([np.empty(0), *found])[plan.inverse]

    def _checked(self, index: IntArray) -> IntArray:
        index = np.asarray(index, dtype=np.int64)
        outside = index[(index < 0) | (index >= self.mesh.n_vertices)]
        if outside.size:
            raise ConfigError(
                f"{self.mesh.label}: vertex {outside[0]} was asked for, but there are {self.mesh.n_vertices}"
            )
        return index

    def _joined(self, sources: IntArray, targets: IntArray) -> BoolArray:
        a, b = self.local[sources], self.local[targets]
        joined: BoolArray = (a != b) & (a >= 0) & (b >= 0) & (self.component[a] == self.component[b])
        return joined

    def _prepare(self) -> None:
        """Set up what the method needs once per mesh."""

    def _reach(self, source: int, targets: IntArray) -> FloatArray:
        """Measure from a used vertex to others of its component, all numbered among the used ones."""
        raise NotImplementedError


class _Exact(_OnMesh):
    method = "exact"

    def _prepare(self) -> None:
        _require_window_propagation(self.mesh)
        self.algorithm = PyGeodesicAlgorithmExact(self.vertices, self.faces)

    def _reach(self, source: int, targets: IntArray) -> FloatArray:
        # With the limit 0 the front goes on exactly until it has passed the last target.  Asking for a vertex that it
        # never reaches would give an undefined number, which is why targets stay inside one component.
        found: FloatArray = self.algorithm.geodesicDistances(np.array([source]), targets, 0.0)[0]
        return found if np.isfinite(found).all() else self._filled(source)[targets]

    def _filled(self, source: int) -> FloatArray:
        """Return the row of a used vertex, in which vertices that no window has reached go by their neighbours.

        Beside faces that are a thousandth of others in size, as marching cubes make them, rounding may lose the windows
        of a single vertex.  What its neighbours are away, and the edge to them, is a little too long.
        """
        reached = np.flatnonzero(self.component == self.component[source])
        row = np.full(len(self.used), np.inf)
        row[reached] = self.algorithm.geodesicDistances(np.array([source]), reached, 0.0)[0]
        lost = reached[~np.isfinite(row[reached])]
        for _ in lost:  # as many rounds as a chain of them may need
            row[lost] = [(row[near.indices] + near.data).min() for near in (self.graph[[i]] for i in lost)]
            if np.isfinite(row[lost]).all():
                break
        return row


class _Heat(_OnMesh):
    method = "heat"
    symmetric = False

    def _prepare(self) -> None:
        self.solver = potpourri3d.MeshHeatMethodDistanceSolver(self.vertices, self.faces)

    def _reach(self, source: int, targets: IntArray) -> FloatArray:
        row: FloatArray = self.solver.compute_distance(source)
        return row[targets]


class _Edge(_OnMesh):
    method = "edge"

    def rows(self, sources: IntArray) -> FloatArray:
        sources = self._checked(sources)
        out = np.full((len(sources), self.mesh.n_vertices), np.inf)
        out[np.arange(len(sources)), sources] = 0.0
        at = self.local[sources]
        out[np.ix_(at >= 0, self.used)] = dijkstra(self.graph, indices=at[at >= 0])
        return out

    def _reach(self, source: int, targets: IntArray) -> FloatArray:
        straight = np.linalg.norm(self.vertices[targets] - self.vertices[source], axis=1).max()
        near = self._dijkstra(source, limit=2.0 * float(straight))[targets]
        return near if np.isfinite(near).all() else self._dijkstra(source, limit=np.inf)[targets]

    def _dijkstra(self, source: int, limit: float) -> FloatArray:
        row: FloatArray = dijkstra(self.graph, indices=np.array([source]), limit=limit)[0]
        return row


def can_be_exact(mesh: Mesh) -> bool:
    """Tell whether exact distances can be measured on a mesh: it is a manifold, and no edge has length zero."""
    return not _against_window_propagation(mesh)


def _against_window_propagation(mesh: Mesh) -> list[str]:
    problems = [
        f"{f.text} ({f.count})" for f in check(mesh) if f.kind in ("non_manifold_edges", "non_manifold_vertices")
    ]
    heads, tails = mesh.corners, mesh.corners[:, [1, 2, 0]]
    if (no_length := (heads == tails).all(axis=2)).any():
        problems.append(f"edges of no length ({int(no_length.sum())})")
    return problems


def _require_window_propagation(mesh: Mesh) -> None:
    problems = _against_window_propagation(mesh)
    if problems:
        raise MeshError(
            f"{mesh.label}: exact geodesics need a manifold, but there are {'; '.join(problems)}; mend the mesh "
            "(csm clean), or choose the distance heat or edge"
        )
