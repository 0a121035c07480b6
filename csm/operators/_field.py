"""Diffusion of a field of tangent vectors on big meshes: conjugate gradients with a cycle of two grids."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import reverse_cuthill_mckee
from scipy.sparse.linalg import LinearOperator, cg, splu

from csm._types import ComplexArray, FloatArray, IntArray
from csm.operators._grids import Smoother
from csm.operators.coarsening import cells, spread_out

_REACH = 4  # edges of the dual graph within which no two faces stand for their surroundings
_SMOOTHING = 3
_RESIDUAL = 1e-10
_STEPS = 500  # meshes need some 20


class FieldDiffusion:
    """Solves  (diag(area) + time K) z = b  for a connection Laplacian K of M faces, without a factorisation of it.

    The coarse grid has one unknown per cell of faces; a face's value is that of its cell's centre, carried over from
    face to face, so that a smooth field is one on the coarse grid too.

    Parameters
    ----------
    laplacian
        Hermitian, shape (M, M), with entries  -w t  where t carries over and w > 0.
    area
        Shape (M,), positive.
    """

    def __init__(self, laplacian: sparse.csc_array, area: FloatArray) -> None:
        self._order = reverse_cuthill_mckee(laplacian, symmetric_mode=True)
        self._area = area[self._order]
        self._laplacian = sparse.csr_array(laplacian)[self._order][:, self._order]
        self._laplacian.sort_indices()
        self._carried = _carried(self._laplacian)

    def solve(self, right: ComplexArray, time: float) -> ComplexArray | None:
        """Return the solution for a right-hand side, shape (M,); None if it does not converge."""
        matrix = sparse.csr_array(sparse.diags_array(self._area) + time * self._laplacian)
        smooth = Smoother(matrix, _SMOOTHING)
        relaxed = sparse.diags_array(4 / 3 * smooth.weights) @ (matrix @ self._carried)
        up = sparse.csr_array(self._carried - relaxed)
        down = sparse.csr_array(up.conj().T)
        coarse: Any = splu(sparse.csc_array(down @ (matrix @ up)))

        def cycle(left: ComplexArray) -> ComplexArray:
            left = left.ravel()
            found = smooth(left)
            found += np.asarray(up @ coarse.solve(down @ (left - matrix @ found)))
            found += smooth(np.asarray(left - matrix @ found))
            return found

        inverse = LinearOperator(matrix.shape, matvec=cycle, dtype=np.complex128)
        gradients: Any = cg  # whose types know no complex numbers
        z, unfinished = gradients(matrix, right[self._order], rtol=_RESIDUAL, maxiter=_STEPS, M=inverse)
        found = np.empty_like(right)
        found[self._order] = z
        return None if unfinished else found


def _carried(laplacian: sparse.csr_array) -> sparse.csr_array:
    """Return the matrix, (M, C), that carries the value of each cell's centre over to its faces."""
    n = laplacian.shape[0]
    entries = laplacian.tocoo()
    off = entries.row != entries.col
    graph = sparse.csr_array((np.ones(off.sum()), (entries.row[off], entries.col[off])), shape=(n, n))
    seeds = spread_out(graph, _REACH)
    cell, before = cells(graph, seeds, unweighted=True)
    return sparse.csr_array((_along_paths(laplacian, before), (np.arange(n), cell)), shape=(n, len(seeds)))


def _along_paths(laplacian: sparse.csr_array, before: IntArray) -> ComplexArray:
    """Return the product of what carries over along the path from each cell's centre to a face, shape (M,)."""
    n = len(before)
    inner = np.flatnonzero(before >= 0)
    values = np.ones(n, dtype=np.complex128)
    steps = np.asarray(laplacian[inner, before[inner]]).ravel()
    values[inner] = -steps / np.abs(steps)
    place = np.where(before >= 0, before, np.arange(n))
    while (place != place[place]).any():  # each round doubles the way that is done
        values *= values[place]
        place = place[place]
    return values
