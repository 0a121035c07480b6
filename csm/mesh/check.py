"""Check a mesh for defects and peculiarities: findings with counts and the first vertices or faces.  No repairs.

On a mesh with findings of severity "error" spectral operators fail: they would divide by zero, get a singular mass
matrix, or spread a NaN.  Findings of severity "note" change what a result means, and are stored beside it.
Indices out of range and 1-based files never get here, because `Mesh` and the readers refuse them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from csm._types import BoolArray, FloatArray, IntArray
from csm.errors import MeshError
from csm.mesh.debris import DEBRIS, body_of
from csm.mesh.inputs import MeshLike, as_mesh
from csm.mesh.shape import Mesh
from csm.mesh.topology import components, edge_keys

Severity = Literal["error", "note"]

FLAT = 1e-10
"""A face whose area is below this fraction of its longest edge squared counts as having no area: its cotangents would
be beyond 1e9."""

SIZES = (1e-4, 1e4)
"""Square roots of the surface area between which a scale is unremarkable (metres, centimetres and millimetres fit)."""

SMALLEST = 1e-70
"""Width of a mesh below which squares of areas may be below the smallest numbers that there are."""

_N_FIRST = 5


@dataclass(frozen=True)
class Finding:
    """One kind of defect or peculiarity of a mesh.

    Parameters
    ----------
    kind
        Short name, such as "boundary".
    count
        How many vertices, faces, edges or components are affected.
    first
        Up to five of them: vertex or face indices, as `text` says.
    severity
        "error" if spectral operators cannot work on the mesh, "note" otherwise.
    text
        One phrase for people.
    """

    kind: str
    count: int
    first: tuple[int, ...]
    severity: Severity
    text: str


def check(mesh: MeshLike) -> tuple[Finding, ...]:
    """Return all findings about a mesh, given in any way that `csm.mesh.inputs.as_mesh` takes; errors come first.

    Examples
    --------
    >>> square = Mesh(np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [9, 9, 9]]), np.array([[0, 1, 2]]))
    >>> [(f.kind, f.count, f.first, f.severity) for f in check(square)]
    [('unreferenced_vertices', 1, (3,), 'note'), ('boundary', 3, (0, 1, 2), 'note')]
    """
    mesh = as_mesh(mesh)
    topology = _Topology(mesh)
    finite = bool(np.isfinite(mesh.vertices[topology.referenced]).all())
    tests: list[Callable[[_Topology], Iterator[Finding]]] = [_faces, _references, _edges, _fans, _components]
    tests = [*tests, _degenerate, _duplicates, _scale] if finite else [_non_finite, *tests]
    with np.errstate(over="ignore", invalid="ignore"):  # of coordinates that findings are about
        findings = [finding for test in tests for finding in test(topology)]
    return tuple(sorted(findings, key=lambda f: f.severity != "error"))


def flat_faces(mesh: Mesh) -> BoolArray:
    """Return which faces, shape (M,), have no area, see `FLAT`."""
    longest = (np.roll(mesh.corners, -1, axis=1) - mesh.corners) ** 2
    flat: BoolArray = mesh.face_areas <= FLAT * longest.sum(axis=2).max(axis=1)
    return flat


def too_small(places: FloatArray) -> str:
    """Return a phrase where corners, shape (n, 3), are so close together that areas underflow; else nothing."""
    size = float(np.ptp(places, axis=0).max()) if len(places) else 0.0
    if not 0 < size < SMALLEST:
        return ""
    return f"the mesh is only {size:.3g} wide, and areas of its faces are too small for numbers; scale it up"


def require_usable(mesh: Mesh) -> None:
    """Raise a MeshError that lists all errors `check` finds, if there are any."""
    errors = [finding.text for finding in check(mesh) if finding.severity == "error"]
    if errors:
        raise MeshError(
            f"{mesh.label}: {'; '.join(errors)}. Spectral operators need this mended; `csm clean` does what can be "
            "done, and keeps the map from the old vertices to the new ones"
        )


@dataclass(frozen=True, eq=False)
class _Topology:
    """A mesh with the half-edges that several tests need; half-edge h is side h // M of face h % M."""

    mesh: Mesh

    @cached_property
    def tails(self) -> IntArray:
        """Start vertex of each half-edge, shape (3 M,)."""
        return self.mesh.faces.T.ravel()

    @cached_property
    def heads(self) -> IntArray:
        """End vertex of each half-edge, shape (3 M,)."""
        return self.mesh.faces[:, [1, 2, 0]].T.ravel()

    @cached_property
    def edge_of(self) -> IntArray:
        """Number of the undirected edge under each half-edge, shape (3 M,)."""
        keys = edge_keys(self.tails, self.heads, self.mesh.n_vertices)
        return np.unique(keys, return_inverse=True)[1].ravel()

    @cached_property
    def referenced(self) -> BoolArray:
        """Which vertices a face uses, shape (N,)."""
        used = np.zeros(self.mesh.n_vertices, dtype=bool)
        used[self.mesh.faces] = True
        return used

    @cached_property
    def proper(self) -> BoolArray:
        """Which half-edges join two different vertices, shape (3 M,)."""
        proper: BoolArray = self.tails != self.heads
        return proper

    @cached_property
    def edge_uses(self) -> IntArray:
        """Number of faces at the edge of each half-edge, shape (3 M,)."""
        return np.bincount(self.edge_of)[self.edge_of]


def _found(
    kind: str, severity: Severity, what: str, where: NDArray[np.integer], count: int | None = None, at: str = ""
) -> Finding:
    """Make a finding whose text is the phrase, the count and the first affected vertices or faces."""
    count = len(where) if count is None else count
    first = tuple(int(i) for i in where[:_N_FIRST])
    shown = at + ", ".join(map(str, first)) + (", ..." if len(where) > len(first) else "")
    return Finding(kind, count, first, severity, f"{what}: {count} ({shown})")


def _non_finite(t: _Topology) -> Iterator[Finding]:
    where = np.flatnonzero(t.referenced & ~np.isfinite(t.mesh.vertices).all(axis=1))
    yield _found("non_finite", "error", "vertices with coordinates that are not finite", where)


def _faces(t: _Topology) -> Iterator[Finding]:
    if t.mesh.n_faces == 0:
        yield Finding("no_faces", 0, (), "error", "no faces: a point cloud or curves, of which no surface is made")


def _references(t: _Topology) -> Iterator[Finding]:
    if t.mesh.n_faces and not t.referenced.all():
        yield _found("unreferenced_vertices", "note", "vertices in no face", np.flatnonzero(~t.referenced))


def _degenerate(t: _Topology) -> Iterator[Finding]:
    """Faces without area, vertices that only such faces touch (no mass), and a surface without area."""
    mesh = t.mesh
    if mesh.n_faces == 0:
        return
    flat = flat_faces(mesh)
    if flat.all():
        small = too_small(mesh.vertices[t.referenced])
        why = f": {small}" if small else ", so there is no surface"
        yield Finding("zero_total_area", mesh.n_faces, (), "error", f"no face has an area{why}")
    elif flat.any():
        yield _found("zero_area_faces", "note", "faces of zero area", np.flatnonzero(flat))
        alive = np.zeros(mesh.n_vertices, dtype=bool)
        alive[mesh.faces[~flat]] = True
        massless = np.flatnonzero(body_of(mesh).vertices & ~alive)
        if massless.size:
            yield _found("massless_vertices", "error", "vertices in faces of zero area only", massless)


def _duplicates(t: _Topology) -> Iterator[Finding]:
    mesh = t.mesh
    vertices = _repeated_rows(mesh.vertices)
    if vertices.size:
        yield _found("duplicate_vertices", "note", "vertices in the place of an earlier one", vertices)
    faces = _repeated_rows(np.sort(mesh.faces, axis=1))
    if faces.size:
        yield _found("duplicate_faces", "note", "faces with the corners of an earlier one", faces)


def _repeated_rows(rows: NDArray[np.generic]) -> IntArray:
    """Return the indices of rows that equal an earlier row."""
    order = np.lexsort(rows.T)  # stable: equal rows keep their order
    same = (rows[order[1:]] == rows[order[:-1]]).all(axis=1)
    return np.sort(order[1:][same])


def _edges(t: _Topology) -> Iterator[Finding]:
    """Boundary, non-manifold edges, and edges that both faces run through the same way; edges are named by a vertex."""
    border = t.proper & (t.edge_uses == 1)
    if border.any():
        where = np.unique(t.tails[border])
        yield _found("boundary", "note", "boundary edges", where, int(border.sum()), "at vertices ")
    crowded = np.unique(t.edge_of[t.proper & (t.edge_uses > 2)], return_index=True)
    if crowded[0].size:
        where = np.flatnonzero(t.proper & (t.edge_uses > 2))[crowded[1]]
        yield _found("non_manifold_edges", "note", "edges with more than two faces", t.tails[where], at="at vertices ")
    yield from _orientation(t)


def _orientation(t: _Topology) -> Iterator[Finding]:
    sense = np.where(t.tails < t.heads, 1, -1)
    balance = np.bincount(t.edge_of, weights=sense)[t.edge_of]
    wrong = np.flatnonzero(t.proper & (t.edge_uses == 2) & (balance != 0))
    edges, index = np.unique(t.edge_of[wrong], return_index=True)
    if edges.size:
        what = "edges whose two faces are oriented against each other"
        yield _found("inconsistent_orientation", "note", what, t.tails[wrong[index]], at="at vertices ")
    elif t.mesh.n_faces and (t.edge_uses == 2).all() and np.isfinite(t.mesh.corners).all() and t.mesh.signed_volume < 0:
        yield Finding("inside_out", t.mesh.n_faces, (), "note", "all faces are oriented inwards")


def _fans(t: _Topology) -> Iterator[Finding]:
    """Vertices whose faces fall apart into several fans.

    The nodes of the graph are the corners (face, vertex), numbered as the half-edges that leave them; two corners of a
    vertex are joined where their faces share an edge at it.
    """
    m, n_corners = t.mesh.n_faces, len(t.tails)
    if m == 0:
        return
    half = np.argsort(t.edge_of, kind="stable")
    together = t.edge_of[half[1:]] == t.edge_of[half[:-1]]
    a, b = half[:-1][together], half[1:][together]
    after = (np.arange(n_corners) + m) % n_corners  # corner at the head of a half-edge, in the same face
    same_way = t.tails[a] == t.tails[b]
    rows = np.concatenate([a, after[a]])
    columns = np.concatenate([np.where(same_way, b, after[b]), np.where(same_way, after[b], b)])
    fan = components(rows, columns, n_corners)
    first_corner = np.unique(fan, return_index=True)[1]
    n_fans = np.bincount(t.tails[first_corner], minlength=t.mesh.n_vertices)
    where = np.flatnonzero(n_fans > 1)
    if where.size:
        yield _found("non_manifold_vertices", "note", "vertices whose faces form several fans", where)


def _components(t: _Topology) -> Iterator[Finding]:
    label = components(t.tails, t.heads, t.mesh.n_vertices)
    used = np.flatnonzero(t.referenced)
    first = used[np.unique(label[used], return_index=True)[1]]
    if len(first) > 1:
        where = np.sort(first)
        yield _found("several_components", "note", "components", where, at="first vertices ")
        body = body_of(t.mesh)
        if body.n_debris:
            out = first[~body.vertices[first]]
            share = f"together {body.area_left_out:.2%}"
            what = f"components of less than {DEBRIS:.0%} of the area ({share}), which take no part"
            yield _found("debris", "note", what, np.sort(out), at="first vertices ")


def _scale(t: _Topology) -> Iterator[Finding]:
    size = float(np.sqrt(t.mesh.area))
    if not np.isfinite(size):
        far = np.abs(t.mesh.vertices).max(axis=1)
        where = np.flatnonzero(t.referenced & (far > 1e100))
        yield _found("overflow", "error", "vertices so far away that areas are beyond all numbers", where)
        return
    if size > 0 and not SIZES[0] <= size <= SIZES[1]:
        word = "tiny" if size < SIZES[0] else "huge"
        yield Finding(f"{word}_scale", 1, (), "note", f"{word} scale: the square root of the area is {size:.3g}")
