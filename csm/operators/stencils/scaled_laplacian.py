"""The stencil "scaled_laplacian": the symmetric normalised Laplacian with its spectrum scaled to [-1, 1]."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal, TypeAlias, get_args

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import eigsh

from csm._types import Arrays
from csm.errors import ConfigError
from csm.mesh.shape import Mesh
from csm.mesh.topology import directed_edges
from csm.operators.laplacian import stiffness
from csm.operators.operators import Operators
from csm.operators.stencils.base import Stencil

LaplacianKind: TypeAlias = Literal["graph", "cotangent"]


@dataclass(frozen=True)
class ScaledLaplacian(Stencil):
    r"""2 L / lambda_max - I with  L = D^{-1/2} S D^{-1/2},  S a Laplacian of the mesh and D its diagonal.

    The arrays `indptr` (N + 1,), `indices` and `values` (nnz,) are the matrix as CSR; it is symmetric.

    Parameters
    ----------
    laplacian
        S: ``"graph"``, the number of neighbours on the diagonal and -1 for each of them, or ``"cotangent"``, the
        stiffness matrix.

    Raises
    ------
    ConfigError
        If `laplacian` is unknown.

    References
    ----------
    Defferrard, Bresson, Vandergheynst, "Convolutional neural networks on graphs with fast localized spectral
    filtering", NeurIPS 2016.
    """

    laplacian: LaplacianKind

    name: ClassVar[str] = "scaled_laplacian"

    def __post_init__(self) -> None:
        if self.laplacian not in get_args(LaplacianKind):
            raise ConfigError(f"{self}: laplacian must be one of {', '.join(get_args(LaplacianKind))}")

    def __call__(self, operators: Operators) -> Arrays:
        """Return the three arrays of the matrix."""
        mesh = operators.mesh
        matrix = stiffness(mesh) if self.laplacian == "cotangent" else graph_laplacian(mesh)
        root = np.sqrt(matrix.diagonal())
        rows = np.repeat(np.arange(len(root)), np.diff(matrix.indptr))
        matrix.data = matrix.data / (root[rows] * root[matrix.indices])
        matrix.data *= 2 / greatest_eigenvalue(matrix)
        matrix.data[rows == matrix.indices] -= 1
        return {
            "indptr": matrix.indptr.astype(np.int64),
            "indices": matrix.indices.astype(np.int64),
            "values": matrix.data,
        }


def graph_laplacian(mesh: Mesh) -> sparse.csr_array:
    """Return the combinatorial Laplacian of the mesh's edges, (N, N): positive semidefinite, rows sum to zero."""
    n = mesh.n_vertices
    edges, vertices = directed_edges(mesh.faces, n), np.arange(n)
    values = np.concatenate([np.bincount(edges.targets, minlength=n), np.full(len(edges.targets), -1.0)])
    rows, columns = np.concatenate([vertices, edges.targets]), np.concatenate([vertices, edges.sources])
    return sparse.csr_array(sparse.coo_array((values, (rows, columns)), shape=(n, n)))


def greatest_eigenvalue(matrix: sparse.csr_array) -> float:
    """Return the greatest eigenvalue of a symmetric matrix to about six digits, the same on every call."""
    start = np.random.default_rng(0).standard_normal(matrix.shape[0])
    return float(eigsh(matrix, 1, which="LA", v0=start, tol=1e-6, return_eigenvectors=False)[0])
