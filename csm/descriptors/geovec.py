"""Geometry vectors: squared eigenfunctions gathered by cubic B-splines over the spectrum."""

from __future__ import annotations

import numpy as np

from csm._types import FloatArray


def spline_weights(evals: FloatArray, n: int, step: float, *, shift: float = 0.0) -> FloatArray:
    """Return B(lambda / step - i + shift) for i = 0 .. n - 1, shape (K, n).

    B is the uniform cubic B-spline on [0, 4], greatest (2/3) at 2; inside the range of knots the columns sum to 1.
    With `shift` 0, spline i begins at i steps; with 2 it is centred there.
    """
    from scipy.interpolate import BSpline  # here, since it takes longer to import than all descriptors together

    x = evals[:, None] / step - np.arange(n) + shift
    bump = BSpline.basis_element(np.arange(5.0))
    weights: FloatArray = np.where((x > 0) & (x < 4), bump(np.clip(x, 0.0, 4.0)), 0.0)
    return weights


def geometry_vectors(evals: FloatArray, evecs: FloatArray, n: int, step: float, *, shift: float = 0.0) -> FloatArray:
    """Return sum_k B(lambda_k / step - i + shift) phi_k^2 for every vertex and i = 0 .. n - 1, (N, n), in 1/area.

    Parameters
    ----------
    evals, evecs
        Eigenpairs, shapes (K,) and (N, K).
    n
        Number of splines (150 in the published code).
    step
        Distance of the knots, in the unit of the eigenvalues: for one shape lambda_K / (n - 1); for a training set
        the 99th percentile of its eigenvalues in place of lambda_K.
    shift
        Of `spline_weights`.

    References
    ----------
    Litman, Bronstein, "Learning spectral descriptors for deformable shape correspondence", PAMI 2014.
    """
    return evecs**2 @ spline_weights(evals, n, step, shift=shift)
