"""The stencil "albo": anisotropic Laplacians of all angles, scaled for Chebyshev polynomials."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import eigsh

from csm._types import Arrays, FloatArray
from csm.errors import ConfigError
from csm.operators.frames import FrameKind
from csm.operators.operators import Operators
from csm.operators.stencils.base import Stencil

_DENSE_BELOW = 100  # rows
_TOLERANCE = 1e-8  # of the largest eigenvalue


@dataclass(frozen=True)
class AnisotropicLaplacians(Stencil):
    r"""One symmetric matrix per angle, with eigenvalues in [-1, 1], all of one sparsity pattern.

    With S the anisotropic stiffness of an angle and A the vertex areas, ACSCNN filters by polynomials of

    .. math::
        \tilde L = \frac{2}{\lambda} A^{-1} S' - I, \qquad
        S' = |\mathrm{diag}(A^{-1} S)|^{-1/2} \, S \, |\mathrm{diag}(A^{-1} S)|^{-1/2}

    where lambda is the largest eigenvalue of A^-1 S', whose diagonal is 1.  Kept is the symmetric matrix that is
    similar to it, with the same eigenvalues,

    .. math::
        M = A^{1/2} \tilde L A^{-1/2} = \frac{2}{\lambda} |\mathrm{diag}(S)|^{-1/2} S |\mathrm{diag}(S)|^{-1/2} - I

    Parameters
    ----------
    alpha
        Strength of the anisotropy.
    angles
        Number J of angles, evenly spaced in [0, pi).
    frame, sweeps, smoothing
        Of `csm.operators.frames.face_frames`.

    Raises
    ------
    ConfigError
        If `alpha` is negative or `angles` below 1.

    References
    ----------
    Li et al., "Shape correspondence using anisotropic Chebyshev spectral CNNs", CVPR 2020, and its released code.  That
    code has diagonals below zero and takes their (imaginary) square roots, which amounts to the absolute value.
    """

    alpha: float
    angles: int
    frame: FrameKind
    sweeps: int
    smoothing: float

    name: ClassVar[str] = "albo"

    def __post_init__(self) -> None:
        if not self.alpha >= 0 or self.angles < 1:
            raise ConfigError(f"{self}: wanted alpha of at least 0 and angles of at least 1")

    def __call__(self, operators: Operators) -> Arrays:
        """Return `indptr` (N + 1,) and `indices` (nnz,) of the pattern, and `values` (J, nnz) of the matrices M."""
        stiffness = operators.anisotropic(frame=self.frame, sweeps=self.sweeps, smoothing=self.smoothing)
        thetas = np.arange(self.angles) * (np.pi / self.angles)
        pattern = stiffness.b0
        return {
            "indptr": pattern.indptr,
            "indices": pattern.indices,
            "values": np.stack([scaled(stiffness.at(self.alpha, theta)).data for theta in thetas]),
        }


def scaled(stiffness: sparse.csr_array) -> sparse.csr_array:
    """Return 2 M / lambda_max(M) - I with M = |diag|^-1/2 S |diag|^-1/2, (N, N), in the pattern of S.

    The pattern has every diagonal entry; a vertex without stiffness gets the row of -I.
    """
    diagonal = np.abs(stiffness.diagonal())
    root = np.sqrt(np.divide(1.0, diagonal, out=np.zeros_like(diagonal), where=diagonal > 0))
    rows = np.repeat(np.arange(len(root)), np.diff(stiffness.indptr))
    on_diagonal = rows == stiffness.indices
    data = stiffness.data * root[rows] * root[stiffness.indices]
    normalised = sparse.csr_array((data, stiffness.indices, stiffness.indptr), shape=stiffness.shape)
    data = data * (2.0 / _largest_eigenvalue(normalised)) - on_diagonal
    return sparse.csr_array((data, stiffness.indices, stiffness.indptr), shape=stiffness.shape)


def _largest_eigenvalue(matrix: sparse.csr_array) -> float:
    n = matrix.shape[0]
    if n < _DENSE_BELOW:
        return float(np.linalg.eigvalsh(matrix.toarray())[-1])
    start: FloatArray = np.random.default_rng(0).standard_normal(n)
    return float(eigsh(matrix, k=1, which="LA", v0=start, tol=_TOLERANCE, return_eigenvectors=False)[0])
