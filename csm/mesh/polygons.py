"""Meshes whose faces have any number of corners, as files hold them, and their triangulation."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from csm._counts import counted
from csm._types import BoolArray, FloatArray, IntArray
from csm.errors import MeshError
from csm.mesh._ears import split_polygons
from csm.mesh.shape import Mesh, positions, require_in_range, whole_numbers


@dataclass(frozen=True, eq=False)
class PolygonMesh:
    """Vertices and faces of any number of corners; what a file holds before anything is decided about it.

    Its arrays are read-only copies.

    Parameters
    ----------
    vertices
        Shape (N, 3).
    corners
        Shape (sum of `sizes`,): the 0-based vertices of all faces, one face after the other.
    sizes
        Shape (M,): how many corners each face has.
    name, source, notes
        As of `csm.mesh.shape.Mesh`.

    Raises
    ------
    MeshError
        If the shapes do not fit, the numbers are of a wrong kind, or a face refers to a vertex that does not exist.
    """

    vertices: FloatArray
    corners: IntArray
    sizes: IntArray
    name: str = "mesh"
    source: str = ""
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        vertices = positions(self.vertices, self.label)
        corners = whole_numbers(self.corners, f"{self.label}: faces")
        sizes = whole_numbers(self.sizes, f"{self.label}: numbers of corners")
        if corners.ndim != 1 or sizes.ndim != 1 or (sizes < 0).any() or sizes.sum() != len(corners):
            raise MeshError(
                f"{self.label}: corners have shape {corners.shape} and sizes {sizes.shape}, wanted one list of corners "
                "and, for each face, how many of them are its own"
            )
        require_in_range(corners, sizes, len(vertices), self.label)
        for key, array in (("vertices", vertices), ("corners", corners), ("sizes", sizes)):
            array.setflags(write=False)
            object.__setattr__(self, key, array)

    @classmethod
    def of(cls, mesh: Mesh) -> PolygonMesh:
        """Return a triangle mesh as one of polygons."""
        sizes = np.full(mesh.n_faces, 3, dtype=np.int64)
        return cls(mesh.vertices, mesh.faces.ravel(), sizes, mesh.name, mesh.source, mesh.notes)

    @property
    def label(self) -> str:
        """What messages call it: the file as it was given, else the name."""
        return self.source or self.name

    @property
    def n_vertices(self) -> int:
        """Number of vertices, N."""
        return len(self.vertices)

    @property
    def n_faces(self) -> int:
        """Number of faces, M."""
        return len(self.sizes)

    @cached_property
    def starts(self) -> IntArray:
        """Where each face begins in `corners`, shape (M,)."""
        return np.cumsum(self.sizes) - self.sizes

    @property
    def all_triangles(self) -> bool:
        """Whether every face has three corners."""
        return bool((self.sizes == 3).all())

    def triangles(self) -> Mesh:
        """Return the mesh if all of its faces are triangles.

        Raises
        ------
        MeshError
            If a face has another number of corners.
        """
        other = np.flatnonzero(self.sizes != 3)
        if other.size:
            few = (self.sizes < 3).any()
            raise MeshError(
                f"{self.label}: face {other[0]} has {counted(self.sizes[other[0]], 'corner')} ({other.size} of "
                f"{len(self.sizes)} faces are no triangles), and csm computes on triangles; `csm clean` triangulates "
                f"them{' and leaves out those of fewer than three corners' if few else ''}"
            )
        faces = self.corners.reshape(-1, 3)
        return Mesh(self.vertices, faces, self.name, source=self.source, notes=self.notes)

    def triangulated(self) -> Triangulated:
        """Return the mesh with its faces split into triangles; see `triangulated`."""
        return triangulated(self)

    def __repr__(self) -> str:
        return f"PolygonMesh({self.name!r}, {counted(self.n_vertices, 'vertex')}, {counted(self.n_faces, 'face')})"


@dataclass(frozen=True, eq=False)
class Triangulated:
    """A mesh whose polygons were split into triangles.

    Parameters
    ----------
    mesh
        The triangles, in the order of the polygons; vertices are the polygon mesh's, to the bit.
    face_map
        Shape (M,): the polygon that each triangle is a part of.
    """

    mesh: Mesh
    face_map: IntArray


def triangulated(polygons: PolygonMesh) -> Triangulated:
    """Split every polygon into triangles between its own corners; triangles stay as they are.

    A quad is split along the diagonal whose two triangles agree in orientation and, of these, along the shorter; a
    larger polygon by cutting off ears in its mean plane, so that a flat polygon that does not cross itself keeps its
    area, convex or not.  A corner that is the same vertex as the one before it is counted once.  Faces of fewer than
    three corners are left out.  What was left out or could not be split cleanly is in the `notes` of the mesh.
    """
    corners, sizes, notes = polygons.corners, polygons.sizes, list(polygons.notes)
    repeated = _repeats_its_neighbour(polygons) & np.repeat(sizes > 3, sizes)
    if repeated.any():
        owner = np.repeat(np.arange(len(sizes)), sizes)
        touched = len(np.unique(owner[repeated]))
        notes.append(
            f"{counted(touched, 'polygon names', 'polygons name')} a vertex twice in a row; it was counted once"
        )
        corners, sizes = corners[~repeated], np.bincount(owner[~repeated], minlength=len(sizes))
    few = int((sizes < 3).sum())
    if few:
        notes.append(
            counted(
                few,
                "face has fewer than three corners and was left out",
                "faces have fewer than three corners and were left out",
            )
        )
    faces, face_map, crossing = split_polygons(polygons.vertices, corners, sizes)
    if len(crossing):
        notes.append(
            f"{len(crossing)} polygons, the first of them face {crossing[0]}, cannot be split cleanly because they "
            "cross themselves; their triangles overlap"
        )
    mesh = Mesh(polygons.vertices, faces, polygons.name, source=polygons.source, notes=tuple(notes))
    face_map.setflags(write=False)
    return Triangulated(mesh, face_map)


def _repeats_its_neighbour(polygons: PolygonMesh) -> BoolArray:
    """Tell of each corner whether it is the same vertex as the one before it in its face, going round."""
    if len(polygons.corners) == 0:
        return np.zeros(0, dtype=bool)
    before = np.arange(len(polygons.corners)) - 1
    filled = polygons.sizes > 0
    before[polygons.starts[filled]] = polygons.starts[filled] + polygons.sizes[filled] - 1
    repeats: BoolArray = polygons.corners == polygons.corners[before]
    return repeats
