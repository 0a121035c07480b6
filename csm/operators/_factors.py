"""LDL^T factors of many sparse matrices of one pattern: the ordering is found once, and the signs of D count."""

from __future__ import annotations

import numpy as np
import qdldl
from scipy import sparse

from csm._types import FloatArray


class Factors:
    """Factors of  A - shift I  for one symmetric matrix A after the other, all with the same pattern.

    The fill-reducing ordering and the symbolic analysis are made for the first of them.  Not for several threads at
    once: a new matrix takes the place of the one before.

    Parameters
    ----------
    pattern
        A matrix of shape (N, N) with the pattern, symmetric, with sorted indices and a stored diagonal.
    """

    def __init__(self, pattern: sparse.csc_array | sparse.csr_array) -> None:
        entries = sparse.csc_array((np.arange(1.0, pattern.nnz + 1), pattern.indices, pattern.indptr), pattern.shape)
        upper = sparse.csc_matrix(sparse.triu(entries, format="csc"))
        upper.sort_indices()
        self._upper, self._taken = upper, upper.data.astype(np.int64) - 1
        self._diagonal = upper.indptr[1:] - 1
        self._solver: qdldl.Solver | None = None

    def factor(self, matrix: sparse.csc_array, shift: float) -> int:
        """Factor  matrix - shift I  for `solve`; return how many eigenvalues lie below the shift (Sylvester's law).

        Raises
        ------
        RuntimeError
            If a pivot is zero: the shift is an eigenvalue, or nearly.
        """
        values = matrix.data[self._taken]
        values[self._diagonal] -= shift
        self._upper.data = values
        if self._solver is None:
            self._solver = qdldl.Solver(self._upper, upper=True)
        else:
            self._solver.update(self._upper, upper=True)
        pivots: FloatArray = self._solver.factors()[1]
        if not np.isfinite(pivots).all():
            raise RuntimeError(f"the factorisation at {shift:.3g} has a zero pivot")
        return int((pivots < 0).sum())

    def solve(self, columns: FloatArray) -> FloatArray:
        """Return the solutions, shape (N, B), for right-hand sides of the same shape."""
        assert self._solver is not None
        found = np.empty_like(columns, order="F")
        for i, column in enumerate(columns.T):
            found[:, i] = self._solver.solve(np.ascontiguousarray(column))
        return found
