"""Attempts to solve a symmetric sparse eigenproblem, and the checks that accept or reject the eigenpairs."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.linalg import eigh_tridiagonal

from csm._counts import counted
from csm._types import FloatArray
from csm.operators._factors import Factors

_DENSE_BELOW = 400  # rows; smaller problems, and those for more than a quarter of the spectrum, are solved densely
_CONVERGED = 1e-12  # defect of an inverted pair, over its eigenvalue
_RESIDUAL = 1e-7
_ROUNDING = 128 * np.finfo(np.float64).eps  # of the greatest entry of the matrix, what rounding may leave of a residual
_ORTHONORMAL = 1e-8


class Problem(NamedTuple):
    """Find the `k` smallest eigenpairs of a symmetric matrix."""

    matrix: sparse.csc_array  # (N, N)
    k: int
    unit: float  # natural unit of its eigenvalues, 1 / area
    guess: float  # of the greatest wanted eigenvalue
    factors: Factors  # of the pattern of the matrix


class Attempt(NamedTuple):
    """One way to solve the problem.

    `block`: vectors per Lanczos step; 0 is the dense solver.  `within`: invert about a point amid the wanted
    eigenvalues, where they converge soonest; else about one below all, where the factorisation is safest.
    """

    method: str
    block: int
    within: bool = False


class Pairs(NamedTuple):
    """Eigenvalues, ascending, and orthonormal eigenvectors; `residual` of pairs that have been checked."""

    evals: FloatArray  # (K,)
    evecs: FloatArray  # (N, K)
    residual: float = float("nan")


def attempts(problem: Problem) -> tuple[Attempt, ...]:
    """Return the attempts to make, the quickest first.

    Single Lanczos vectors need the fewest solves, but see one copy of an eigenvalue only; where the count misses some,
    blocks find them.
    """
    n, k = problem.matrix.shape[0], problem.k
    if n < _DENSE_BELOW or k > n // 4:
        return (Attempt("the dense solver", 0),)
    block = min(max(k // 10, 2), 8)
    return (
        Attempt("shift-invert", 1, within=k > 3),
        Attempt("shift-invert with blocks", block),
        Attempt("shift-invert with larger blocks", block + 8),
        Attempt("shift-invert with the largest blocks", block + 32),
    )


def attempt_once(problem: Problem, attempt: Attempt) -> tuple[Pairs | None, str]:
    """Return the eigenpairs if they pass the checks, else None and what is wrong."""
    try:
        found = _solve(problem, attempt)
        found = found._replace(residual=_residual(problem, found))
        fault = _fault(problem, found)
    except (RuntimeError, np.linalg.LinAlgError) as error:
        return None, str(error)
    return (None, fault) if fault else (found, "")


def _solve(problem: Problem, attempt: Attempt) -> Pairs:
    matrix, k = problem.matrix, problem.k
    if attempt.block == 0:
        evals, evecs = np.linalg.eigh(matrix.toarray())
        return Pairs(evals[:k], evecs[:, :k])
    shift, below = _factored(problem, attempt)
    solve = problem.factors.solve
    inverted = _lanczos(solve, matrix.shape[0], k, below, attempt.block)
    if attempt.block > 1:
        inverted = _polished(solve, inverted.evecs)
    evals = shift + 1 / inverted.evals
    order = np.argsort(evals)
    return Pairs(evals[order], inverted.evecs[:, order])


def _factored(problem: Problem, attempt: Attempt) -> tuple[float, int]:
    """Factor at the shift of an attempt; return it and how many eigenvalues are below it."""
    k, shift = problem.k, 0.45 * problem.guess
    for _ in range(6 if attempt.within else 0):
        below = problem.factors.factor(problem.matrix, shift)
        if max(1, 0.15 * k) <= below <= 0.9 * k:
            return shift, below
        shift *= np.clip(0.45 * k / max(below, 0.1 * k), 0.2, 5.0)
    problem.factors.factor(problem.matrix, -problem.unit)
    return -problem.unit, 0


def _polished(operator: Callable[[FloatArray], FloatArray], evecs: FloatArray) -> Pairs:
    """Apply the operator once more and take the pairs in the span.

    On meshes with slivers the stiffness is 1e8 times the eigenvalues, so that what rounding has left in the stiffest
    directions weighs heavily in the residual; this divides it by as much.
    """
    span = np.linalg.qr(operator(evecs))[0]
    reduced = span.T @ operator(span)
    evals, mixing = np.linalg.eigh((reduced + reduced.T) / 2)
    return Pairs(evals, span @ mixing)


def _lanczos(operator: Callable[[FloatArray], FloatArray], n: int, k: int, below: int, block: int) -> Pairs:
    """Return `below` least and `k - below` greatest pairs of a symmetric (N, N) operator, if they converge.

    Block Lanczos from a fixed start, without restarts: a space larger than one with restarts would be costs less than
    they do.
    """
    limit = min(6 * k + 40 * block, n - block) // block * block
    basis = np.empty((n, limit + block), order="F")  # unused columns take no memory
    reduced = np.zeros((limit + block, limit + block))  # the operator in the basis, lower half, block tridiagonal
    basis[:, :block] = _orthonormal(np.random.default_rng(0).standard_normal((n, block)))[0]
    look = (1.5 * k + 10) if below else (2.2 * k + 12 * block)  # where meshes are about to converge
    for size in range(block, limit + 1, block):
        _step(operator, basis[:, : size + block], reduced, block)
        if size >= min(look, limit):
            evals, mixing = _ritz(reduced[:size, :size], block)
            wanted = np.r_[:below, size - k + below : size]
            evals, mixing = evals[wanted], mixing[:, wanted]
            defect = np.linalg.norm(reduced[size : size + block, size - block : size] @ mixing[-block:], axis=0)
            apart = (evals[:below] < 0).all() and (evals[below:] > 0).all()
            if apart and (defect <= _CONVERGED * np.abs(evals)).all():
                break
            look = max(1.04 * size, size + 2)
    return Pairs(evals, basis[:, :size] @ mixing)


def _ritz(reduced: FloatArray, block: int) -> tuple[FloatArray, FloatArray]:
    """Return the pairs of the operator in the basis, of which `reduced` has the lower half."""
    tridiagonal = block == 1
    evals, mixing = (
        eigh_tridiagonal(reduced.diagonal(), reduced.diagonal(-1)) if tridiagonal else np.linalg.eigh(reduced)
    )
    return np.asarray(evals, np.float64), np.asarray(mixing, np.float64)


def _step(operator: Callable[[FloatArray], FloatArray], basis: FloatArray, reduced: FloatArray, block: int) -> None:
    """Fill the last `block` columns of the basis, and those of `reduced` that belong to the block before."""
    size = basis.shape[1] - block
    here, after = slice(size - block, size), slice(size, size + block)
    known, recent = basis[:, :size], basis[:, max(size - 2 * block, 0) : size]
    image = operator(basis[:, here])
    along = recent.T @ image
    image -= recent @ along
    image -= known @ (known.T @ image)  # zero but for rounding, which would grow
    reduced[here, here] = along[-block:]
    basis[:, after], reduced[after, here] = _orthonormal(image)


def _orthonormal(columns: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the QR factors; of a single column in a tenth of the time that the general way takes."""
    if columns.shape[1] > 1:
        return np.linalg.qr(columns)
    length = np.sqrt(columns[:, 0] @ columns[:, 0])
    return columns / length, np.array([[length]])


def _fault(problem: Problem, found: Pairs) -> str:
    """Return what is wrong with the pairs, or an empty string."""
    if not found.residual <= _RESIDUAL and not _only_rounding(problem, found):
        return f"the relative residual is {found.residual:.1e}, wanted at most {_RESIDUAL:.0e}"
    error = np.abs(found.evecs.T @ found.evecs - np.eye(problem.k)).max()
    if not error <= _ORTHONORMAL:
        return f"the eigenvectors are orthonormal only to {error:.1e}"
    missing = _missing(problem, found.evals)
    return counted(missing, "eigenvalue was passed over", "eigenvalues were passed over") if missing else ""


def _residual(problem: Problem, found: Pairs) -> float:
    """Return the greatest defect of a pair over the greatest eigenvalue (over the unit if that is greater)."""
    defect = np.linalg.norm(problem.matrix @ found.evecs - found.evecs * found.evals, axis=0).max()
    return float(defect / max(found.evals[-1], problem.unit))


def _only_rounding(problem: Problem, found: Pairs) -> bool:
    """Tell whether nothing but rounding is left in a residual that is too great, by the defect of the inverted pairs.

    On meshes with slivers, as marching cubes make them, the matrix is up to 1e12 times the eigenvalues in a few stiff
    directions, so that the last digit of a vector makes a residual there.  The inverse hardly sees these directions.
    """
    largest = float(np.abs(problem.matrix.data).max())
    if not found.residual <= _ROUNDING * largest / max(found.evals[-1], problem.unit):
        return False
    problem.factors.factor(problem.matrix, -problem.unit)
    inverted = problem.factors.solve(found.evecs) * (found.evals + problem.unit)
    return bool(np.linalg.norm(found.evecs - inverted, axis=0).max() <= _RESIDUAL)


def _missing(problem: Problem, evals: FloatArray) -> int:
    """Count the eigenvalues that `evals` should contain and does not, up to its last clear gap."""
    gaps = np.flatnonzero(np.diff(evals) > 1e-5 * max(evals[-1], problem.unit))
    if gaps.size == 0:
        return 0
    last = gaps[-1]
    bound = 0.5 * (evals[last] + evals[last + 1])
    return problem.factors.factor(problem.matrix, bound) - int(last + 1)
