"""Meshes whose faces have any number of corners, as files hold them, and their triangulation."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from csm._types import FloatArray, IntArray
from csm.errors import MeshError
from csm.mesh.shape import Mesh


@dataclass(frozen=True, eq=False)
class PolygonMesh:
    """Vertices and faces of any number of corners; what a file holds before anything is decided about it.

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
        If the shapes do not fit or a face refers to a vertex that does not exist.
    """

    vertices: FloatArray
    corners: IntArray
    sizes: IntArray
    name: str = "mesh"
    source: str = ""
    notes: tuple[str, ...] = ()

    @classmethod
    def of(cls, mesh: Mesh) -> PolygonMesh:
        """Return a triangle mesh as one of polygons."""
        sizes = np.full(mesh.n_faces, 3, dtype=np.int64)
        return cls(mesh.vertices, mesh.faces.ravel(), sizes, mesh.name, mesh.source, mesh.notes)

    @property
    def label(self) -> str:
        """What messages call it: the file as it was given, else the name."""
        return self.source or self.name

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
            raise MeshError(
                f"{self.label}: face {other[0]} has {self.sizes[other[0]]} corners ({other.size} of {len(self.sizes)} "
                "faces are no triangles), and csm computes on triangles; `csm clean` triangulates them"
            )
        faces = self.corners.reshape(-1, 3)
        return Mesh(self.vertices, faces, self.name, source=self.source, notes=self.notes)
