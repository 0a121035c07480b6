r"""Functional maps: a map between shapes as a small matrix between their Laplacian eigenfunctions, and back.

A vertex map T: source -> target pulls functions on the target back to the source, f -> f o T.  In the first K
eigenfunctions of both shapes, Phi_s and Phi_t, this is the matrix

.. math:: C = \Phi_s^\top A_s \, \Phi_t[T], \qquad (K_s, K_t),

with the vertex areas A_s of the source: column j holds the coefficients of the pulled-back eigenfunction j of the
target.  So **a functional map of csm goes from coefficients on the target to coefficients on the source**, against the
direction of the vertex map (Ovsjanikov et al., "Functional Maps", 2012, section 3; pyFM's `FM_12` of mesh1 = target and
mesh2 = source).  An isometry that keeps areas gives an orthogonal C that commutes with the Laplacians.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from csm._counts import counted
from csm._types import FloatArray, IntArray
from csm.errors import ConfigError
from csm.matching.nearest import nearest
from csm.operators.spectrum import Spectrum


@dataclass(frozen=True, eq=False)
class FunctionalMap:
    """A functional map of a vertex map source -> target: it takes coefficients on the target to those on the source.

    Parameters
    ----------
    matrix
        Shape (K_source, K_target); column j has the coefficients on the source of eigenfunction j of the target, pulled
        back.
    source, target
        Names of the shapes.

    Raises
    ------
    ConfigError
        If it is no matrix, or a number is not finite.

    Examples
    --------
    >>> FunctionalMap(np.eye(3)[:, :2], "a", "b")
    FunctionalMap(of a -> b, 3 x 2)
    """

    matrix: FloatArray
    source: str = "source"
    target: str = "target"

    def __post_init__(self) -> None:
        matrix = np.asarray(self.matrix, dtype=np.float64)
        if matrix.ndim != 2 or not np.isfinite(matrix).all():
            raise ConfigError(f"a functional map of shape {matrix.shape}: wanted a matrix of finite numbers")
        object.__setattr__(self, "matrix", matrix)

    def pull(self, coefficients: FloatArray) -> FloatArray:
        """Return the coefficients on the source, (K_source, ...), of functions with coefficients (K_target, ...)."""
        pulled: FloatArray = np.tensordot(self.matrix, coefficients, axes=(1, 0))
        return pulled

    def orthogonal(self) -> FunctionalMap:
        """Return the nearest matrix with orthonormal columns or rows, see `orthogonal`."""
        return FunctionalMap(orthogonal(self.matrix), self.source, self.target)

    def __repr__(self) -> str:
        rows, columns = self.matrix.shape
        return f"FunctionalMap(of {self.source} -> {self.target}, {rows} x {columns})"


def functional_map(
    indices: IntArray, source: Spectrum, target: Spectrum, k: int, k_target: int | None = None
) -> FloatArray:
    """Return the functional map of a vertex map source -> target.

    Parameters
    ----------
    indices
        Shape (N_source,): for each vertex of the source one of the target; -1 where there is none, which is left out.
    source, target
        Eigenpairs of the two shapes.
    k, k_target
        K_source and K_target; K_target is K_source by default.

    Returns
    -------
    FloatArray
        Shape (K_source, K_target).  Where vertices are left out the coefficients are those of least squares over the
        others.

    Raises
    ------
    ConfigError
        If a spectrum has fewer eigenpairs, or there are fewer than K_source matched vertices.

    Examples
    --------
    >>> import csm
    >>> spectrum = csm.Operators(csm.load_humans().mesh("s00_p00")).lbo(5)
    >>> identity = np.arange(len(spectrum.mass))
    >>> bool(np.allclose(functional_map(identity, spectrum, spectrum, 5), np.eye(5)))
    True
    """
    phi, psi = source.first(k).evecs, target.first(k_target or k).evecs
    weighted = phi * source.mass[:, None]
    matched = indices >= 0
    if matched.all():
        return weighted.T @ psi[indices]
    if matched.sum() < k:
        raise ConfigError(
            f"{counted(int(matched.sum()), 'matched vertex', 'matched vertices')} cannot give a functional map of {k} "
            "eigenfunctions"
        )
    left, right = weighted[matched].T @ phi[matched], weighted[matched].T @ psi[indices[matched]]
    return np.linalg.solve(left, right).astype(np.float64)


def vertex_map(
    matrix: FloatArray, source: Spectrum, target: Spectrum, *, adjoint: bool = False, device: str = "cpu"
) -> IntArray:
    """Return the vertex map source -> target of a functional map.

    Parameters
    ----------
    matrix
        Shape (K_source, K_target).
    source, target
        Eigenpairs of the two shapes.
    adjoint
        False: vertex x of the source goes to the y whose row of Phi_t is nearest to row x of Phi_s C (the pulled-back
        eigenfunctions of the target take the values that they have there).  True: to the y whose row of Phi_t C^T is
        nearest to row x of Phi_s (delta functions carried by the adjoint; ZoomOut, pyFM).  For orthogonal C of one
        size both agree.
    device
        Where distances are computed.

    Returns
    -------
    IntArray
        Shape (N_source,).
    """
    k, k_target = matrix.shape
    phi, psi = source.first(k).evecs, target.first(k_target).evecs
    queries, candidates = (phi, psi @ matrix.T) if adjoint else (phi @ matrix, psi)
    if device == "cpu":
        return nearest(queries, candidates)
    import torch

    return nearest(torch.as_tensor(queries, device=device), torch.as_tensor(candidates, device=device))


def orthogonal(matrices: FloatArray) -> FloatArray:
    """Return the nearest matrices (..., K, L) of orthonormal columns, or rows if they are wide: the polar factors.

    Examples
    --------
    >>> orthogonal(np.diag([2.0, 0.5]))
    array([[1., 0.],
           [0., 1.]])
    """
    u, _, v = np.linalg.svd(matrices, full_matrices=False)
    factors: FloatArray = u @ v
    return factors
