"""The stencil "edge_splines": spline weights of the directed edges, for spline-based convolutions."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import ClassVar, NamedTuple

import numpy as np

from csm._types import Arrays, FloatArray, IntArray
from csm.errors import ConfigError
from csm.mesh.shape import Mesh
from csm.mesh.topology import DirectedEdges, directed_edges
from csm.operators.operators import Operators
from csm.operators.stencils.base import Stencil


def pseudo_coordinates(mesh: Mesh, edges: DirectedEdges) -> FloatArray:
    """Return the vectors from target to source, (E, 3), scaled and moved so that the whole shape fills [0, 1]^3.

    The scale is the greatest component of any edge of the shape, and 1/2 in each direction is no step at all.
    """
    steps = mesh.vertices[edges.sources] - mesh.vertices[edges.targets]
    coordinates: FloatArray = steps / (2 * np.abs(steps).max()) + 0.5
    return coordinates


class Corners(NamedTuple):
    """The control points around each position: `points` and their `weights`, shape (E, 8) each; rows sum to 1."""

    points: IntArray
    weights: FloatArray


def linear_splines(positions: FloatArray, kernel: int) -> Corners:
    """Return where and how much positions in [0, 1]^3, shape (E, 3), touch a grid of `kernel` control points per axis.

    The basis is the product of the hat functions of the axes.  Control point (a, b, c) has number a + b s + c s^2 for a
    kernel of s, so that the mirror image in the centre of number m is s^3 - 1 - m.
    """
    scaled = positions * (kernel - 1)
    low = np.clip(np.floor(scaled).astype(np.int64), 0, kernel - 2)
    above = scaled - low
    strides = kernel ** np.arange(3)
    points, weights = [], []
    for corner in product((0, 1), repeat=3):
        points.append((low + corner) @ strides)
        weights.append(np.where(corner, above, 1 - above).prod(axis=1))
    return Corners(np.stack(points, axis=1), np.stack(weights, axis=1))


@dataclass(frozen=True)
class EdgeSplines(Stencil):
    """For every control point of a spline kernel, the sparse matrix that gathers neighbours by its basis function.

    With u the pseudo-coordinates of the edge from t to its neighbour s, matrix m has the entries B_m(u) at (t, s).
    Since the way back has 1 - u, its transpose is matrix s^3 - 1 - m.  Rows without entries are left out; the arrays
    are

    - `indptr` (R + 1,), `indices` and `values` (nnz,): the other rows of all matrices below each other, as CSR;
    - `targets` (R,): the vertex of each row, ascending within a matrix;
    - `offsets` (s^3 + 1,): matrix m has the rows from offset m up to offset m + 1;
    - `degrees` (N,): how many neighbours each vertex has.

    Parameters
    ----------
    kernel
        s, control points per axis, at least 2.

    Raises
    ------
    ConfigError
        If `kernel` is out of its range.

    Notes
    -----
    Extrinsic: turning the shape changes it, moving and scaling it do not.  At 6890 vertices there are 330,000 entries
    in 175,000 rows.

    References
    ----------
    Fey, Lenssen, Weichert, Mueller, "SplineCNN: fast geometric deep learning with continuous B-spline kernels", CVPR
    2018; the scale of the coordinates is that of the authors' PyTorch Geometric.
    """

    kernel: int

    name: ClassVar[str] = "edge_splines"

    def __post_init__(self) -> None:
        if self.kernel < 2:
            raise ConfigError(f"{self}: wanted a kernel of at least 2 control points per axis")

    def __call__(self, operators: Operators) -> Arrays:
        """Return the arrays of all matrices."""
        mesh, n = operators.mesh, operators.mesh.n_vertices
        edges = directed_edges(mesh.faces, n)
        corners = linear_splines(pseudo_coordinates(mesh, edges), self.kernel)
        edge, corner = np.nonzero(corners.weights)
        keys = corners.points[edge, corner] * n + edges.targets[edge]
        order = np.argsort(keys, kind="stable")  # keeps the sources of a row ascending
        rows, sizes = np.unique(keys[order], return_counts=True)
        return {
            "indptr": np.concatenate([[0], np.cumsum(sizes)]),
            "indices": edges.sources[edge][order],
            "values": corners.weights[edge, corner][order],
            "targets": rows % n,
            "offsets": np.searchsorted(rows, n * np.arange(self.kernel**3 + 1)),
            "degrees": np.bincount(edges.targets, minlength=n).astype(np.float64),
        }
