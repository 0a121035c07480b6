"""What cycles of two grids share: a smoother, and how strong it may be."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from scipy import sparse

from csm._types import ComplexArray, Float32Array, FloatArray

Columns = TypeVar("Columns", Float32Array, FloatArray, ComplexArray)


class Smoother:
    """Chebyshev polynomials of the fourth kind in a matrix over its diagonal (Lottes 2023).

    They make the stiff part of an error small, and leave the rest to a coarse grid.

    Parameters
    ----------
    matrix
        Hermitian and positive semidefinite, shape (N, N).
    degree
        Products with the matrix per call, and one more.
    """

    def __init__(self, matrix: sparse.csr_array, degree: int) -> None:
        self._matrix, self._degree = matrix, degree
        diagonal = matrix.diagonal().real
        self.weights = 1 / (_greatest(matrix, diagonal) * diagonal)

    def __call__(self, columns: Columns) -> Columns:
        """Return a first approximation of the solution for right-hand sides of shape (N,) or (N, B)."""
        weights = self.weights.reshape(-1, *[1] * (columns.ndim - 1))
        number = weights.dtype.type
        step, left, scaled = columns.copy(), columns.copy(), np.empty_like(columns)
        step *= weights * number(4 / 3)
        found = step.copy()
        for i in range(1, self._degree):
            left -= np.asarray(self._matrix @ step)
            step *= number((2 * i - 1) / (2 * i + 3))
            step += np.multiply(left, weights * number((8 * i + 4) / (2 * i + 3)), out=scaled)
            found += step
        return found


def _greatest(matrix: sparse.csr_array, diagonal: FloatArray) -> float:
    """Return a little more than the greatest eigenvalue of a matrix over its diagonal."""
    vector = np.random.default_rng(0).standard_normal(len(diagonal)).astype(diagonal.dtype)
    size = 1.0
    for _ in range(20):
        vector = (matrix @ (vector / diagonal.dtype.type(size))) / diagonal
        size = float(np.linalg.norm(vector))
    return 1.1 * size
