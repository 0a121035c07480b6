"""The triangle mesh: two arrays and a name, never changed after it is made."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from csm._counts import counted
from csm._places import load
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
        If the arrays do not have these shapes, are not real numbers, faces are not whole numbers, or a face refers to
        a vertex that does not exist.
    """

    vertices: FloatArray
    faces: IntArray
    name: str = "mesh"
    scale: float = 1.0
    source: str = ""
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        vertices = positions(self.vertices, self.label)
        faces = whole_numbers(self.faces, f"{self.label}: faces")
        if faces.ndim != 2 or faces.shape[1] != 3:
            raise MeshError(
                f"{self.label}: faces have shape {faces.shape}, wanted (M, 3): csm reads triangle meshes only"
            )
        require_in_range(faces.ravel(), np.full(len(faces), 3), len(vertices), self.label)
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

    @property
    def signed_volume(self) -> float:
        """Volume inside a closed surface: positive if its faces are counter-clockwise from outside."""
        centre = self.corners.mean(axis=(0, 1))
        return float(np.einsum("ij,ij->", self.corners[:, 0] - centre, self.face_crosses) / 6)

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

    def _repr_html_(self) -> str | None:
        """Show the mesh in a notebook."""
        frame: str | None = load("csm.viewer.notebook:mesh_frame")(self)
        return frame

    def __repr__(self) -> str:
        return f"Mesh({self.name!r}, {counted(self.n_vertices, 'vertex')}, {counted(self.n_faces, 'face')})"


def positions(values: ArrayLike, label: str) -> FloatArray:
    """Return a float64 copy of the vertices of the mesh `label`, shape (N, 3); MeshError if they are something else."""
    vertices = real_numbers(values, f"{label}: vertices")
    if vertices.ndim != 2 or vertices.shape[1] != 3:
        raise MeshError(f"{label}: vertices have shape {vertices.shape}, wanted (N, 3)")
    return vertices


def real_numbers(values: ArrayLike, what: str) -> FloatArray:
    """Return a float64 copy of what are real numbers already; nothing is cut off to make it fit.

    Raises
    ------
    MeshError
        If they are complex, truth values, text or objects, or do not form an array; `what` begins the message.
    """
    array = _as_array(values, what)
    if array.dtype.kind not in "iuf":
        raise MeshError(f"{what} are {_kind_in_words(array)}, wanted real numbers")
    with np.errstate(over="ignore", invalid="ignore"):  # of wider types and signalling NaN
        return np.array(array, dtype=np.float64, order="C")


def whole_numbers(values: ArrayLike, what: str) -> IntArray:
    """Return an int64 copy of whole numbers; floating-point ones count if every one of them is whole.

    Raises
    ------
    MeshError
        If they are of another kind or one is not whole; `what` begins the message.
    """
    array = _as_array(values, what)
    if array.dtype.kind not in "iuf":
        raise MeshError(f"{what} are {_kind_in_words(array)}, wanted whole numbers")
    if array.dtype.kind == "f":
        with np.errstate(invalid="ignore"):
            odd = array[~(np.abs(array) < 2.0**53) | (array != np.round(array))]
        if odd.size:
            raise MeshError(f"{what} hold {odd.flat[0]}, wanted whole numbers: a vertex number has no fraction")
    elif array.dtype == np.uint64:
        array = np.minimum(array, np.uint64(2**63 - 1))
    return np.array(array, dtype=np.int64, order="C")


def _as_array(values: ArrayLike, what: str) -> NDArray[Any]:
    try:
        return np.asarray(values)
    except (ValueError, TypeError) as error:
        raise MeshError(f"{what} form no array of numbers ({error})") from None


def _kind_in_words(array: NDArray[Any]) -> str:
    words = {"c": "complex (the imaginary part would be lost)", "b": "truth values", "O": "Python objects"}
    return words.get(array.dtype.kind, f"of the kind {array.dtype}")


def require_in_range(corners: IntArray, sizes: IntArray, n: int, label: str) -> None:
    """Refuse faces, given one after the other, that refer to a vertex outside of 0..n-1.

    Raises
    ------
    MeshError
        Naming the first such face; a 1-based numbering is recognised and said.
    """
    outside = np.flatnonzero((corners < 0) | (corners >= n))
    if outside.size == 0:
        return
    face = int(np.searchsorted(np.cumsum(sizes), outside[0], side="right"))
    one_based = corners.min() == 1 and corners.max() == n
    hint = "; the indices run from 1, so the file is 1-based: subtract 1" if one_based else ""
    there = f"there are {n} (0..{n - 1})" if n else "there is none"
    raise MeshError(f"{label}: face {face} refers to vertex {corners[outside[0]]}, but {there}{hint}")
