"""Maps from vertices into the faces of another surface, and the precise map: the nearest point of an embedded surface.

Source: Ezuz, Ben-Chen, *Deblurring and Denoising of Maps between Shapes*, Computer Graphics Forum 36(5), 2017.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse

from csm._counts import counted
from csm._types import FloatArray, IntArray
from csm.errors import ConfigError, DataError
from csm.matching._triangles import nearest_triangles
from csm.matching.maps import VertexMap, numbers_or_none
from csm.mesh.shape import Mesh

_ROUNDING = 1e-6


@dataclass(frozen=True, eq=False)
class BarycentricMap:
    """A map source -> target: for each vertex of the source a point in a face of the target.

    Parameters
    ----------
    faces
        Shape (N_source,): number of a face of the target, 0-based; -1 where a vertex has no partner.
    weights
        Shape (N_source, 3): shares of the three corners of that face, from 0 to 1, which sum to 1.
    target_faces
        Shape (M_target, 3): the vertices of the target's faces.
    n_target
        Number of vertices of the target.
    source, target
        Names of the shapes.

    Raises
    ------
    DataError
        If the shapes do not fit, a face does not exist, or weights are no shares.

    Examples
    --------
    >>> found = BarycentricMap(np.array([0, -1]), np.array([[0.5, 0.5, 0], [0, 0, 0]]), np.array([[0, 1, 2]]), 3)
    >>> found.pull([10.0, 20.0, 70.0])
    array([15., nan])
    """

    faces: IntArray
    weights: FloatArray
    target_faces: IntArray
    n_target: int
    source: str = "source"
    target: str = "target"

    def __post_init__(self) -> None:
        faces = numbers_or_none(self.faces, len(self.target_faces), f"{self.source} -> {self.target}: the faces are")
        weights = np.array(self.weights, dtype=np.float64)
        if weights.shape != (len(faces), 3):
            raise DataError(f"{self.source} -> {self.target}: weights {weights.shape}, wanted ({len(faces)}, 3)")
        weights[faces < 0] = 0.0
        off = np.abs(weights.sum(1) - (faces >= 0)) > _ROUNDING
        bad = np.flatnonzero(off | ~(weights >= -_ROUNDING).all(1))
        if bad.size:
            raise DataError(
                f"{self.source} -> {self.target}: the weights of vertex {bad[0]} are {weights[bad[0]].tolist()}; "
                "wanted three shares from 0 to 1 that sum to 1"
            )
        object.__setattr__(self, "faces", faces)
        object.__setattr__(self, "weights", np.clip(weights, 0.0, 1.0))

    @classmethod
    def of_vertices(cls, vertex_map: VertexMap, target_faces: IntArray) -> BarycentricMap:
        """Return a map to vertices as one to corners of faces; a vertex in no face is the partner of none."""
        m = len(target_faces)
        corner_of = np.full(vertex_map.n_target, -1, dtype=np.int64)
        corner_of[target_faces.ravel()[::-1]] = np.arange(3 * m)[::-1]
        corner = np.where(vertex_map.indices >= 0, corner_of[vertex_map.indices], -1)
        weights = (corner[:, None] % 3 == np.arange(3)).astype(np.float64)
        faces = np.where(corner >= 0, corner // 3, -1)
        return cls(faces, weights, target_faces, vertex_map.n_target, vertex_map.source, vertex_map.target)

    @property
    def corners(self) -> IntArray:
        """Shape (N_source, 3): the vertices of the target that each point lies between; -1 where there is none."""
        return np.where(self.faces[:, None] >= 0, self.target_faces[self.faces], -1)

    def vertex_map(self) -> VertexMap:
        """Return the map to the corner of greatest weight; of equal ones, to the vertex of lowest number."""
        corners = self.corners
        best = np.where(self.weights >= self.weights.max(1, keepdims=True) - 1e-12, corners, self.n_target).min(1)
        indices = np.where(self.faces >= 0, best, -1)
        return VertexMap(indices, self.n_target, self.source, self.target)

    def pull(self, values: ArrayLike) -> NDArray[Any]:
        """Bring values of the target's vertices, shape (N_target, ...), to the source's, shape (N_source, ...).

        Within a face values are linear.  A corner of weight 0 takes no part, whatever its value is; NaN where there is
        no partner.

        Raises
        ------
        DataError
            If there is not one value per vertex of the target.
        """
        given = np.asarray(values)
        if given.ndim == 0 or len(given) != self.n_target:
            raise DataError(
                f"{self.source} -> {self.target}: values of shape {given.shape} cannot be pulled back; wanted one row "
                f"for each of the {self.n_target} vertices of {self.target}"
            )
        corners, out = self.corners, np.zeros((len(self.faces), *given.shape[1:]), dtype=np.result_type(given, 1.0))
        for i in range(3):
            used = self.weights[:, i] > 0
            shares = self.weights[used, i].reshape(-1, *[1] * (given.ndim - 1))
            out[used] += shares * given[corners[used, i]]
        out[self.faces < 0] = np.nan
        return out

    def points(self, target: Mesh) -> FloatArray:
        """Return where the vertices of the source land on the target, shape (N_source, 3); NaN for those that do not.

        Raises
        ------
        DataError
            If the mesh has another number of vertices than the target.
        """
        return self.pull(target.vertices)

    def matrix(self) -> sparse.csr_matrix:
        """Return the map as a sparse matrix, (N_source, N_target): times values of the target it is `pull`.

        The row of a vertex without a partner is zero.
        """
        rows, columns = np.nonzero(self.weights)
        entries = (self.weights[rows, columns], (rows, self.corners[rows, columns]))
        return sparse.csr_matrix(entries, shape=(len(self.faces), self.n_target))

    def __len__(self) -> int:
        return len(self.faces)

    def __repr__(self) -> str:
        return (
            f"BarycentricMap({self.source} -> {self.target}, {counted(len(self.faces), 'vertex')} to "
            f"{counted(len(self.target_faces), 'face')})"
        )


def nearest_on_faces(
    queries: ArrayLike,
    embedding: ArrayLike,
    faces: IntArray,
    *,
    source: str = "source",
    target: str = "target",
) -> BarycentricMap:
    """Find, for each query, the nearest point (Euclidean) of a triangle mesh in a space of Q dimensions.

    With spectral embeddings, or these beside descriptors, it is the precise map of Ezuz and Ben-Chen, and with Q = 3
    the projection onto a surface.  The result is exact.  Most faces are ruled out by their corners: from a point at
    squared distances d_i^2 to the corners of a triangle, the squared distance to the triangle is at least
    min d_i^2 - r^2, where r is the radius of the smallest ball around the triangle.  Of faces at the same distance, up
    to rounding, the one of lowest number is taken.

    Parameters
    ----------
    queries
        Shape (N_source, Q).
    embedding
        Shape (N_target, Q): where the vertices of the target are.
    faces
        Shape (M, 3): the faces of the target.
    source, target
        Names of the shapes.

    Raises
    ------
    ConfigError
        If the shapes do not fit, there is no face, or a number is not finite.

    Examples
    --------
    >>> square, faces = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]]), np.array([[0, 1, 2], [0, 2, 3]])
    >>> found = nearest_on_faces([[0.5, -3.0], [0.25, 0.75]], square, faces)
    >>> found.faces, found.pull(square)
    (array([0, 1]), array([[0.5 , 0.  ],
           [0.25, 0.75]]))
    """
    q, v, f = (np.asarray(values, dtype) for values, dtype in ((queries, float), (embedding, float), (faces, np.int64)))
    if q.ndim != 2 or v.ndim != 2 or q.shape[1] != v.shape[1] or f.ndim != 2 or f.shape[1:] != (3,) or len(f) == 0:
        raise ConfigError(
            f"nearest_on_faces: queries {q.shape} against {v.shape} with faces {f.shape}; wanted (N, Q), (N', Q) and "
            "(M, 3) with M > 0"
        )
    if not (np.isfinite(q).all() and np.isfinite(v[f]).all()):
        raise ConfigError("nearest_on_faces: a number is not finite, so it has no nearest point; look at the features")
    found = nearest_triangles(q, v, f)
    return BarycentricMap(found.faces, found.weights, f, len(v), source, target)


def centre_faces(along: BarycentricMap, source: Mesh, target: Mesh) -> BarycentricMap:
    """Return where the centres of the source's faces land on the target: nearest to the mean of where corners land.

    Its rows are faces of the source; -1 for a face with a corner without a partner.
    """
    corners = along.points(target)[source.faces]
    known = np.flatnonzero(np.isfinite(corners).all((1, 2)))
    landed = nearest_on_faces(corners[known].mean(1), target.vertices, target.faces)
    faces, weights = np.full(source.n_faces, -1), np.zeros((source.n_faces, 3))
    faces[known], weights[known] = landed.faces, landed.weights
    return BarycentricMap(faces, weights, target.faces, target.n_vertices, along.source, along.target)
