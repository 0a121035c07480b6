"""The triangle mesh: two arrays and a name, never changed after it is made."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from csm._types import FloatArray, IntArray
from csm.errors import MeshError


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangle mesh; its arrays are read-only copies.

    Parameters
    ----------
    vertices
        Shape (N, 3), any unit of length; stored as float64.
    faces
        Shape (M, 3), 0-based vertex indices, counter-clockwise seen from outside; stored as int64.
    name
        What messages, progress bars and result files call this shape.
    scale
        Length of one unit of `vertices` in the unit of the file the mesh was read from; 1 until `unit_area` is called.
    source
        The file it was read from, as it was given; empty for a mesh made in memory.
    notes
        What the reader noticed in the file, one sentence each.

    Raises
    ------
    MeshError
        If the arrays do not have these shapes or a face refers to a vertex that does not exist.
    """

    vertices: FloatArray
    faces: IntArray
    name: str = "mesh"
    scale: float = 1.0
    source: str = ""
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        vertices = np.array(self.vertices, dtype=np.float64, order="C")
        faces = np.array(self.faces, dtype=np.int64, order="C")
        if vertices.ndim != 2 or vertices.shape[1] != 3:
            raise MeshError(f"{self.label}: vertices have shape {vertices.shape}, wanted (N, 3)")
        if faces.ndim != 2 or faces.shape[1] != 3:
            raise MeshError(
                f"{self.label}: faces have shape {faces.shape}, wanted (M, 3): csm reads triangle meshes only"
            )
        _require_indices_in_range(faces, len(vertices), self.label)
        for key, array in (("vertices", vertices), ("faces", faces)):
            array.setflags(write=False)
            object.__setattr__(self, key, array)

    @property
    def label(self) -> str:
        """What messages call this shape: the file as it was given, else the name."""
        return self.source or self.name

    @property
    def n_vertices(self) -> int:
        """Number of vertices, N."""
        return len(self.vertices)

    @property
    def n_faces(self) -> int:
        """Number of triangles, M."""
        return len(self.faces)

    @cached_property
    def corners(self) -> FloatArray:
        """Corner positions of every triangle, shape (M, 3 corners, 3 coordinates)."""
        return self.vertices[self.faces]

    @cached_property
    def face_crosses(self) -> FloatArray:
        """Cross product of two edges per face, shape (M, 3): twice the area times the outward normal."""
        a, b, c = self.corners[:, 0], self.corners[:, 1], self.corners[:, 2]
        return np.cross(b - a, c - a)

    @cached_property
    def face_areas(self) -> FloatArray:
        """Area of every triangle, shape (M,), in squared units of `vertices`."""
        areas: FloatArray = 0.5 * np.linalg.norm(self.face_crosses, axis=1)
        return areas

    @cached_property
    def vertex_normals(self) -> FloatArray:
        """Unit normal of every vertex, (N, 3): the area-weighted mean over its faces, zero where it has none."""
        corner = self.faces.ravel()
        sums = [np.bincount(corner, np.repeat(self.face_crosses[:, i], 3), self.n_vertices) for i in range(3)]
        total = np.stack(sums, axis=1)
        length = np.linalg.norm(total, axis=1, keepdims=True)
        unit: FloatArray = np.divide(total, length, out=np.zeros_like(total), where=length > 0)
        return unit

    @property
    def area(self) -> float:
        """Total surface area, in squared units of `vertices`."""
        return float(self.face_areas.sum())

    @cached_property
    def digest(self) -> str:
        """SHA-256 (hex) of the geometry: vertex and face bytes and their counts; the name plays no part."""
        h = hashlib.sha256(f"{self.n_vertices},{self.n_faces};".encode())
        h.update(np.ascontiguousarray(self.vertices, dtype="<f8").tobytes())
        h.update(np.ascontiguousarray(self.faces, dtype="<i8").tobytes())
        return h.hexdigest()

    def unit_area(self, area: float | None = None) -> Mesh:
        """Return the same shape scaled about the origin to a total area of 1; `scale` keeps the way back.

        Parameters
        ----------
        area
            What to scale to 1 instead of the total area, such as the area without debris.
        """
        area = self.area if area is None else area
        if not (np.isfinite(area) and area > 0):
            raise MeshError(f"{self.label}: the surface area is {area}, so it cannot be scaled to 1; run `csm check`")
        length = float(np.sqrt(area))
        return replace(self, vertices=self.vertices / length, scale=self.scale * length)

    def __repr__(self) -> str:
        return f"Mesh({self.name!r}, {self.n_vertices} vertices, {self.n_faces} faces)"


def _require_indices_in_range(faces: IntArray, n: int, name: str) -> None:
    outside = np.flatnonzero(((faces < 0) | (faces >= n)).any(axis=1))
    if outside.size == 0:
        return
    row = faces[outside[0]]
    bad = int(row[(row < 0) | (row >= n)][0])
    one_based = faces.min() == 1 and faces.max() == n
    hint = "; the indices run from 1, so the file is 1-based: subtract 1" if one_based else ""
    raise MeshError(f"{name}: face {outside[0]} refers to vertex {bad}, but there are {n} (0..{n - 1}){hint}")
