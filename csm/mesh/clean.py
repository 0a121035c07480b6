"""Cleaning of a mesh, step by step and on request, with the map from its old vertices to the new ones.

Nothing here is done unasked: vertex numbers are the ground truth, so reading never repairs.  `clean` returns a new mesh
and both maps, with which labels and correspondences carry over in either direction.

In this order: polygons become triangles; boundary edges at the same place are welded; faces without three different
corners and repeated faces go; vertices with faces of zero area only are joined with their nearest neighbour;
non-manifold edges and vertices are cut apart; debris goes; vertices in no face go; faces are oriented alike, and
outwards where the surface is closed.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from csm._counts import counted
from csm._types import BoolArray, FloatArray, IntArray
from csm.errors import ConfigError, MeshError
from csm.mesh.check import flat_faces, too_small
from csm.mesh.debris import DEBRIS, body_of
from csm.mesh.inputs import MeshLike, as_polygons
from csm.mesh.mending import collapsed, joined_short_edges, sound_faces, split, turns, welded
from csm.mesh.polygons import PolygonMesh, triangulated
from csm.mesh.shape import Mesh

SAME_PLACE = 1e-5
"""Distance below which ends of boundary edges are welded, as a fraction of the bounding box's diagonal."""

STEPS = ("weld", "split", "debris", "orient")
"""The steps that can be left out; polygons, faces without three corners and vertices in no face always go."""

_AS_A_WHOLE = "inside out as a whole, or a mirror image, of which left and right stay exchanged"


@dataclass(frozen=True)
class Mend:
    """One step that changed something: its kind, how many things it changed, and a phrase for people."""

    kind: str
    count: int
    text: str


@dataclass(frozen=True, eq=False)
class Cleaned:
    """A cleaned mesh and where its vertices come from.

    Parameters
    ----------
    mesh
        The new mesh.
    vertex_map
        Shape (N_old,): the new vertex of each old one, -1 where it was left out.
    origin
        Shape (N_new,): the old vertex that each new one is (the first, where several were welded).
    face_map
        Shape (M_new,): the old face that each new one is, or is a part of.
    mends
        What was done, in order; empty for a mesh that needed nothing.
    """

    mesh: Mesh
    vertex_map: IntArray
    origin: IntArray
    face_map: IntArray
    mends: tuple[Mend, ...] = ()

    @property
    def changes(self) -> tuple[Mend, ...]:
        """What of `mends` changed the mesh: all but the note that a component is one-sided."""
        return tuple(mend for mend in self.mends if mend.kind != "one_sided")

    @property
    def text(self) -> str:
        """What was done, in one line; empty for nothing."""
        return "; ".join(mend.text for mend in self.mends)

    def carried(self, values: FloatArray) -> FloatArray:
        """Return values per old vertex, shape (N_old, ...), as values per new vertex, shape (N_new, ...)."""
        return values[self.origin]

    def __repr__(self) -> str:
        return f"Cleaned({self.mesh!r}, {self.text or 'nothing to do'})"


def clean(
    mesh: MeshLike,
    *,
    weld: bool = True,
    split: bool = True,
    debris: float | None = None,
    orient: bool = True,
    tolerance: float = SAME_PLACE,
) -> Cleaned:
    """Mend a mesh so that descriptors can be computed on it; the module says in which steps.

    Parameters
    ----------
    mesh
        The mesh, also with polygons, in any way that `csm.mesh.inputs.as_mesh` takes; it is not changed.
    weld, split, orient
        Whether to take these steps.
    debris
        Components below this fraction of the area go; 0 keeps all; None for the rule of `csm.mesh.debris`: below 1 %
        each, and 2 % together.
    tolerance
        Of welding, as a fraction of the bounding box's diagonal.

    Raises
    ------
    MeshError
        If there are no faces, or none with an area, or coordinates are not finite.
    ConfigError
        If `debris` or `tolerance` is not from 0 to below 1.

    Examples
    --------
    >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 0, 0], [1, 1, 0], [0, 1, 0], [9, 9, 9]])
    >>> done = clean(Mesh(corners, np.array([[0, 1, 2], [3, 4, 5]])))
    >>> done.mesh.n_vertices, done.vertex_map
    (4, array([ 0,  1,  2,  0,  2,  3, -1]))
    >>> done.text
    '2 vertices welded to another at the same place; 1 vertex in no face left out'
    """
    for name, value in (("debris", 0.0 if debris is None else debris), ("tolerance", tolerance)):
        if isinstance(value, str) or not 0 <= value < 1:
            raise ConfigError(f"{name}={value}; wanted a fraction from 0 to below 1")
    mesh = as_polygons(mesh)
    require_finite(mesh)
    work = _Work.of(mesh)
    unsound = work.drop_unsound_faces()  # a face that is there twice has no boundary to be welded
    if weld:
        work.weld(tolerance)
    work.join_short()
    work.note_unsound_faces(unsound + work.drop_unsound_faces())
    work.collapse(mesh)
    if split:
        work.split()
    lone = ~work.used()
    if debris != 0:
        work.drop_debris(debris)
    work.drop_unused(lone)
    if orient:
        work.orient()
    return work.done(mesh)


def require_finite(mesh: Mesh | PolygonMesh) -> None:
    """Raise a MeshError if a face has a corner that is not finite, or so far away that areas overflow."""
    corners = np.unique(mesh.faces if isinstance(mesh, Mesh) else mesh.corners)
    far = np.abs(mesh.vertices[corners]).max(axis=1)
    bad = corners[~(far < 1e100)]
    if bad.size:
        raise MeshError(
            f"{mesh.label}: {counted(bad.size, 'vertex')} with coordinates that are not finite, or beyond 1e100; the "
            f"first is vertex {bad[0]}: {', '.join(f'{x:g}' for x in mesh.vertices[bad[0]])}"
        )
    if corners.size == 0:
        raise MeshError(f"{mesh.label}: there are no faces; csm works on surfaces, so reconstruct one first")


@dataclass
class _Work:
    """A mesh while it is cleaned, with its way back."""

    vertices: FloatArray
    faces: IntArray
    vertex_map: IntArray  # old -> present
    origin: IntArray  # present -> old
    face_map: IntArray  # present -> old
    mends: list[Mend] = field(default_factory=list)

    @classmethod
    def of(cls, mesh: Mesh | PolygonMesh) -> _Work:
        mends = []
        if isinstance(mesh, Mesh):
            triangles, face_map = mesh, np.arange(mesh.n_faces)
        else:
            found = triangulated(mesh)
            triangles, face_map = found.mesh, found.face_map
            count = int((mesh.sizes != 3).sum())
            if count:
                mends.append(
                    Mend("triangulate", count, counted(count, "polygon triangulated", "polygons triangulated"))
                )
        n = np.arange(triangles.n_vertices)
        return cls(triangles.vertices.copy(), triangles.faces.copy(), n, n.copy(), face_map, mends)

    def _did(self, kind: str, count: int, one: str, text: str) -> None:
        if count:
            self.mends.append(Mend(kind, count, f"{counted(count, one)} {text}"))

    def used(self) -> BoolArray:
        """Which present vertices some face uses; those that were joined with another count as used."""
        used = np.zeros(len(self.vertices), dtype=bool)
        used[self.faces] = True
        return used

    def _join(self, target: IntArray) -> int:
        """Let each vertex be `target` of it, and return how many were joined with another."""
        self.faces, self.vertex_map = target[self.faces], target[self.vertex_map]
        return int((target != np.arange(len(target))).sum())

    def weld(self, tolerance: float) -> None:
        count = self._join(welded(self.vertices, self.faces, tolerance))
        self._did("weld", count, "vertex", "welded to another at the same place")

    def join_short(self) -> None:
        """Join the ends of edges of no length, which have no place in a Laplacian."""
        count = self._join(joined_short_edges(self.vertices, self.faces))
        self._did("short", count, "vertex", "joined with a neighbour at the same place")

    def _keep_faces(self, kept: BoolArray) -> int:
        self.faces, self.face_map = self.faces[kept], self.face_map[kept]
        return int((~kept).sum())

    def drop_unsound_faces(self) -> int:
        return self._keep_faces(sound_faces(self.faces))

    def note_unsound_faces(self, count: int) -> None:
        self._did("faces", count, "face", "left out: corners that coincide, or a face twice")

    def flat(self, mesh: Mesh | PolygonMesh) -> BoolArray:
        """Which present faces have no area; MeshError if none has one."""
        flat = flat_faces(Mesh(self.vertices, self.faces)) if len(self.faces) else np.ones(0, dtype=bool)
        if flat.all():
            n = len(mesh.faces) if isinstance(mesh, Mesh) else len(mesh.sizes)
            every = "its only face vanishes" if n == 1 else f"all of its {n} faces vanish"
            small = too_small(mesh.vertices[np.unique(mesh.faces if isinstance(mesh, Mesh) else mesh.corners)])
            why = small or "corners coincide or lie on a line; no surface is left"
            raise MeshError(f"{mesh.label}: {every}: {why}")
        return flat

    def collapse(self, mesh: Mesh | PolygonMesh) -> None:
        total, flat = 0, self.flat(mesh)
        for _ in range(5):
            count = self._join(collapsed(self.vertices, self.faces, flat))
            if not count:
                break
            total += count
            self._keep_faces(sound_faces(self.faces))
            flat = self.flat(mesh)
        self._did("collapse", total, "vertex", "with faces of zero area only joined with their nearest neighbour")

    def split(self) -> None:
        before = len(self.vertices)
        self.faces, origin = split(self.vertices, self.faces)
        self.vertices, self.origin = self.vertices[origin], self.origin[origin]
        count = len(origin) - before
        self._did("split", count, "copy", "of vertices made where the surface was no manifold")

    def drop_debris(self, fraction: float | None) -> None:
        mesh = Mesh(self.vertices, self.faces)
        body = body_of(mesh) if fraction is None else body_of(mesh, fraction, together=1.0)
        if body.n_debris:
            self._keep_faces(body.faces)
            much = "; WARNING: that is most of it" if body.area_left_out > 0.5 else ""
            text = (
                f"of debris left out: each below {fraction or DEBRIS:.2g} of the area, together "
                f"{body.area_left_out:.2%}{much}"
            )
            self._did("debris", body.n_debris, "piece", text)

    def drop_unused(self, lone: BoolArray) -> None:
        used = self.used()
        present = np.zeros(len(used), dtype=bool)
        present[self.vertex_map] = True
        number = np.where(used, np.cumsum(used) - 1, -1)
        self.faces, self.vertex_map = number[self.faces], number[self.vertex_map]
        self.vertices, self.origin = self.vertices[used], self.origin[used]
        self._did("unreferenced", int((lone & present & ~used).sum()), "vertex", "in no face left out")

    def orient(self) -> None:
        found = turns(self.vertices, self.faces)
        self.faces[found.flip] = self.faces[found.flip][:, ::-1]
        whole = found.n_inside_out
        why = _AS_A_WHOLE if whole and found.flip.all() else "against their neighbours"
        self._did("orient", int(found.flip.sum()), "face", f"turned: {why}")
        if found.n_one_sided:
            text = counted(found.n_one_sided, "component is one-sided", "components are one-sided")
            self.mends.append(Mend("one_sided", found.n_one_sided, f"{text} and cannot be oriented"))

    def done(self, mesh: Mesh | PolygonMesh) -> Cleaned:
        if not self.mends and isinstance(mesh, Mesh):
            return Cleaned(mesh, self.vertex_map, self.origin, self.face_map)
        scale = mesh.scale if isinstance(mesh, Mesh) else 1.0
        new = Mesh(self.vertices, self.faces, mesh.name, scale, mesh.source, mesh.notes)
        return Cleaned(new, self.vertex_map, self.origin, self.face_map, tuple(self.mends))
