"""Eigenpairs of big meshes: from a coarse mesh, refined on the fine one without a factorisation of its matrix.

References: Knyazev, "Toward the optimal preconditioned eigensolver", SIAM J. Sci. Comput. 23(2), 2001.  Lottes,
"Optimal polynomial smoothers for multigrid V-cycles", Numer. Linear Algebra Appl. 30(6), 2023.  Another way from level
to level on meshes: Nasikun and Hildebrandt, "The hierarchical subspace iteration method for Laplace-Beltrami
eigenproblems", ACM TOG 41(2), 2022.
"""

from __future__ import annotations

from collections.abc import Callable
from threading import Lock
from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import reverse_cuthill_mckee

from csm._parallel import thread_map
from csm._types import Float32Array, FloatArray
from csm.errors import ConfigError, NumericalError
from csm.operators._eigensolver import Pairs
from csm.operators._factors import Factors
from csm.operators._grids import Smoother
from csm.operators.coarsening import Coarse
from csm.operators.spectrum import Spectrum, eigenpairs, finished, require_solvable, symmetrised

TOLERANCE = 1e-3
"""Greatest estimated error of an accepted eigenvector, in the norm of the energy, over sqrt(lambda_K)."""

_STEPS = 40  # of refinement; meshes of good faces need 3 to 6
_SMOOTHING = 4  # degree of the smoother before and after the coarse correction
_COLUMNS = 14  # that are corrected at once
_ROWS = 20_000  # that are mixed at once
_SAME = 1e-7  # columns that others span but for this square of their length are left out: rounding would grow


def multilevel_eigenpairs(
    stiffness: sparse.csr_array,
    mass: FloatArray,
    k: int,
    coarse: Coarse,
    *,
    name: str = "mesh",
    density: float = 1.0,
) -> Spectrum:
    """Return the `k` smallest eigenpairs of  S phi = lambda diag(mass) phi  without a factorisation of S.

    The problem is first solved on a coarse mesh, with all the checks of `eigenpairs`.  What is interpolated from there
    is refined by the locally optimal block preconditioned conjugate gradient method; its preconditioner is one cycle of
    two grids with Chebyshev smoothing.  Time and memory grow in proportion to N.

    Parameters
    ----------
    stiffness, mass, k, name, density
        As for `csm.operators.spectrum.eigenpairs`.
    coarse
        Of the mesh.

    Returns
    -------
    Spectrum
        Its `residual` is the greatest estimated error of an eigenvector as in `TOLERANCE`; an eigenvalue errs by about
        the square of it, relative to lambda_K.  That none was passed over is known on the coarse mesh.

    Raises
    ------
    ConfigError
        If more than `most_pairs` are asked for.
    MeshError
        If a vertex has no area or the matrix is not finite.
    NumericalError
        If the refinement does not converge, as on meshes with very thin faces.

    Examples
    --------
    >>> from csm import Operators, load_humans
    >>> from csm.operators.coarsening import coarsen
    >>> from csm.operators.laplacian import stiffness
    >>> operators = Operators(load_humans()[0])
    >>> matrix = stiffness(operators.mesh)
    >>> found = multilevel_eigenpairs(matrix, operators.mass, 10, coarsen(operators.mesh))
    >>> error = abs(found.evals - operators.lbo(10).evals).max() / found.evals[-1]
    >>> bool(error < 1e-6)
    True
    """
    require_solvable(stiffness, mass, k, name)
    if k > most_pairs(coarse):
        raise ConfigError(
            f"{name}: asked for {k} eigenpairs from a coarse mesh of {len(coarse.seeds)} vertices, which is enough for "
            f"{most_pairs(coarse)}; take a finer one, or csm.operators.spectrum.eigenpairs"
        )
    levels = _Levels.of(stiffness, mass, coarse.interpolation)
    first = levels.coarse_pairs(k + max(3, k // 16), name, density)
    found = levels.refined(first, k, name)
    zero = np.arange(k) < np.searchsorted(first.evals, 0.0, side="right")  # one per component, as on the coarse mesh
    return finished(found._replace(evals=np.where(zero, 0.0, found.evals)), mass, 1.0 / np.sqrt(mass))


def most_pairs(coarse: Coarse) -> int:
    """Return how many eigenpairs may be asked for: a quarter of the vertices of the coarse mesh."""
    return len(coarse.seeds) // 4


class _Levels(NamedTuple):
    """The problem on both meshes, and factors of the coarse one's pattern."""

    stiffness: sparse.csr_array
    mass: FloatArray
    up: sparse.csr_array
    reduced: sparse.csr_array
    lumped: FloatArray
    factors: Factors

    @classmethod
    def of(cls, stiffness: sparse.csr_array, mass: FloatArray, up: sparse.csr_array) -> _Levels:
        """Return both problems, the coarse one by Galerkin's way; its areas are lumped."""
        reduced = sparse.csr_array(up.T @ (stiffness @ up))
        reduced.sort_indices()
        return cls(stiffness, mass, up, reduced, up.T @ mass, Factors(reduced))

    def coarse_pairs(self, k: int, name: str, density: float) -> Spectrum:
        """Return the pairs of the coarse problem."""
        return eigenpairs(self.reduced, self.lumped, k, name=name, density=density, factors=self.factors)

    def refined(self, first: Spectrum, k: int, name: str) -> Pairs:
        """Return `k` pairs of the fine problem's symmetric matrix, refined from more of the coarse one."""
        order = reverse_cuthill_mckee(self.stiffness, symmetric_mode=True)  # neighbours near in memory: half the time
        scale, coarse_scale = 1.0 / np.sqrt(self.mass), 1.0 / np.sqrt(self.lumped)
        matrix = sparse.csr_array(symmetrised(self.stiffness, scale).T)[order][:, order]
        up = sparse.csr_array(sparse.diags_array(1.0 / scale) @ self.up @ sparse.diags_array(coarse_scale))[order]
        unit = 1.0 / self.mass.sum()
        grids = _TwoGrids(matrix, symmetrised(self.reduced, coarse_scale), up, self.factors, unit)
        found = _refined(_Space(matrix, up @ (first.evecs / coarse_scale[:, None])), grids, k, unit, name)
        evecs = np.empty((len(order), k))
        evecs[order] = found.evecs
        return found._replace(evecs=evecs)


class _TwoGrids:
    """An approximate inverse of a symmetric matrix: smoothing, a correction from the coarse mesh, and smoothing.

    It works in single precision, which is enough for corrections.  `factors` are of no other use in the meantime.
    """

    def __init__(
        self,
        matrix: sparse.csr_array,
        reduced: sparse.csc_array,
        up: sparse.csr_array,
        factors: Factors,
        unit: float,
    ) -> None:
        self._matrix, self._up = matrix.astype(np.float32), up.astype(np.float32)
        self._down = sparse.csr_array(self._up.T)
        self._smooth = Smoother(self._matrix, _SMOOTHING)
        self._factors, self._lock = factors, Lock()
        self._factors.factor(reduced, -unit)

    def inverse(self, columns: Float32Array) -> Float32Array:
        """Return an approximate solution for right-hand sides of shape (N, B)."""
        found = self._smooth(columns)
        below = self._down @ (columns - self._matrix @ found)
        with self._lock:
            solved = self._factors.solve(below.astype(np.float64))
        found += self._up @ solved.astype(np.float32)
        found += self._smooth(columns - self._matrix @ found)
        return found


class _Strip(NamedTuple):
    """Some rows of a matrix, without the columns before the first and after the last that they have entries in."""

    rows: slice
    reach: slice
    matrix: sparse.csr_array

    @classmethod
    def of(cls, matrix: sparse.csr_array, rows: slice) -> _Strip:
        part = matrix[rows]
        reach = slice(int(part.indices.min()), int(part.indices.max()) + 1)
        return cls(rows, reach, part[:, reach])


class _Space:
    """The columns among which the eigenvectors are sought, and their products with each other and by the matrix.

    There are three blocks of B columns: the approximations, their corrections, and the directions, which are what the
    last step added to the approximations before.  Corrections need single precision only.
    """

    def __init__(self, matrix: sparse.csr_array, start: FloatArray) -> None:
        n, self._size = start.shape
        self._matrix = matrix
        self._strips = [_Strip.of(matrix, slice(at, min(at + _ROWS, n))) for at in range(0, n, _ROWS)]
        self._blocks: list[FloatArray | Float32Array] = [start, np.zeros(start.shape, np.float32), np.zeros_like(start)]
        self._gram, self._energy = (np.zeros((3 * self._size, 3 * self._size)) for _ in range(2))
        self._take_best(0)

    @property
    def found(self) -> FloatArray:
        """The approximations, shape (N, B), of which `evals` are the eigenvalues."""
        return np.asarray(self._blocks[0], np.float64)

    def correct(self, correction: Callable[[Float32Array], Float32Array]) -> FloatArray:
        """Look for corrections of all approximations; return the squared errors of these, shape (B,)."""

        def corrected(begin: int) -> FloatArray:
            some = slice(begin, begin + _COLUMNS)
            columns = self.found[:, some].copy()
            image = self._matrix @ columns
            columns *= self.evals[some]
            columns -= image
            del image  # a hundred megabytes at a million vertices
            defect = columns.astype(np.float32)
            self._blocks[1][:, some] = found = correction(defect)
            squared: FloatArray = np.einsum("nb,nb->b", defect, found, dtype=np.float64)
            return squared

        errors = np.concatenate(thread_map(corrected, list(range(0, self._size, _COLUMNS))))
        return errors.clip(min=0.0)

    def improve(self) -> None:
        """Take the best approximations from what all blocks span."""
        self._take_best(1)

    def _take_best(self, changed: int) -> None:
        """Take the best approximations from all blocks, of which one has changed since the last time."""
        b = self._size
        self._multiply(changed)
        length = np.sqrt(self._gram.diagonal())
        inverse = np.divide(1.0, length, out=np.zeros(3 * b), where=length > 0)
        squares, axes = np.linalg.eigh(self._gram * inverse[:, None] * inverse)
        kept = squares > _SAME
        basis = inverse[:, None] * axes[:, kept] / np.sqrt(squares[kept])
        evals, mixing = np.linalg.eigh(basis.T @ self._energy @ basis)
        self.evals, best = evals[:b], basis @ mixing[:, :b]
        added = best.copy()
        added[:b] = 0.0
        weights = np.hstack([best, np.zeros_like(best), added])
        self._gram, self._energy = (weights.T @ products @ weights for products in (self._gram, self._energy))

        def mixed(strip: _Strip) -> None:
            near, far, last = (block[strip.rows] for block in self._blocks)
            last[:] = far.astype(np.float64, copy=False) @ added[b : 2 * b] + last @ added[2 * b :]
            near[:] = near @ best[:b] + last

        thread_map(mixed, self._strips)

    def _multiply(self, changed: int) -> None:
        """Find the products of one block with all."""
        columns, b = self._blocks[changed], self._size

        def products(strip: _Strip) -> tuple[FloatArray, FloatArray]:
            here = columns[strip.rows].astype(np.float64, copy=False)
            image = strip.matrix @ columns[strip.reach].astype(np.float64, copy=False)
            blocks = [block[strip.rows].astype(np.float64, copy=False) for block in self._blocks]
            return np.vstack([block.T @ here for block in blocks]), np.vstack([block.T @ image for block in blocks])

        found = thread_map(products, self._strips)
        new = slice(changed * b, (changed + 1) * b)
        for whole, parts in zip((self._gram, self._energy), zip(*found, strict=True), strict=True):
            part = np.sum(parts, axis=0)
            whole[:, new], whole[new, :] = part, part.T
            whole[new, new] = (part[new] + part[new].T) / 2


def _refined(space: _Space, grids: _TwoGrids, k: int, unit: float, name: str) -> Pairs:
    """Return the first `k` pairs of a space as soon as they are good enough."""
    for _ in range(_STEPS):
        error = float(np.sqrt(space.correct(grids.inverse)[:k].max() / max(space.evals[k - 1], unit)))
        if error <= TOLERANCE:
            return Pairs(space.evals[:k], space.found[:, :k], error)
        space.improve()
    raise NumericalError(
        f"{name}: {k} eigenpairs of {len(space.found)} vertices were not refined to {TOLERANCE:.0e} in {_STEPS} "
        f"steps, but to {error:.1e}"
    )
