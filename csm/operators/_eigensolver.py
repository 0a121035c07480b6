"""Attempts to solve a symmetric sparse eigenproblem, and the checks that accept or reject the eigenpairs."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import SuperLU, splu

from csm._counts import counted
from csm._types import FloatArray

_DENSE_BELOW = 400  # rows; smaller problems, and those for more than a quarter of the spectrum, are solved densely
_CONVERGED = 1e-11  # defect of an inverted pair, over its eigenvalue
_RESIDUAL = 1e-7
_ORTHONORMAL = 1e-8


class Problem(NamedTuple):
    """Find the `k` smallest eigenpairs of a symmetric matrix."""

    matrix: sparse.csc_array  # (N, N)
    k: int
    unit: float  # natural unit of its eigenvalues, 1 / area


class Attempt(NamedTuple):
    """One way to solve the problem: by Lanczos steps with blocks of `block` vectors, or densely if that is 0."""

    method: str
    shift: float
    block: int


class Pairs(NamedTuple):
    """Eigenvalues, ascending, and orthonormal eigenvectors."""

    evals: FloatArray  # (K,)
    evecs: FloatArray  # (N, K)


def attempts(problem: Problem) -> tuple[Attempt, ...]:
    """Return the attempts to make, the best first."""
    n, k = problem.matrix.shape[0], problem.k
    if n < _DENSE_BELOW or k > n // 4:
        return (Attempt("the dense solver", 0.0, 0),)
    shift = -problem.unit
    block = min(max(k // 10, 2), 8)
    return (
        Attempt("shift-invert", shift, block),
        Attempt("shift-invert in a larger space", shift, block + 8),
        Attempt("shift-invert with a larger shift", 10 * shift, block + 8),
    )


def attempt_once(problem: Problem, attempt: Attempt) -> tuple[Pairs | None, str]:
    """Return the eigenpairs if they pass the checks, else None and what is wrong."""
    try:
        found = _solve(problem, attempt)
        fault = _fault(problem, found)
    except (RuntimeError, np.linalg.LinAlgError) as error:
        return None, str(error)
    return (None, fault) if fault else (found, "")


def _factor(symmetric: sparse.csc_array, shift: float) -> SuperLU:
    """Factor  symmetric - shift I  with diagonal pivots: U's diagonal has a negative entry per eigenvalue below."""
    shifted = sparse.csc_array(symmetric - shift * sparse.eye_array(symmetric.shape[0]))
    return splu(
        shifted, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, panel_size=4, options={"SymmetricMode": True}
    )


def _solve(problem: Problem, attempt: Attempt) -> Pairs:
    matrix, k = problem.matrix, problem.k
    if attempt.block == 0:
        evals, evecs = np.linalg.eigh(matrix.toarray())
        return Pairs(evals[:k], evecs[:, :k])
    solve = _factor(matrix, attempt.shift).solve
    inverted = _polished(solve, _lanczos(solve, matrix.shape[0], k, attempt.block).evecs)
    return Pairs(attempt.shift + 1 / inverted.evals[::-1], inverted.evecs[:, ::-1])


def _polished(operator: Callable[[FloatArray], FloatArray], evecs: FloatArray) -> Pairs:
    """Apply the operator once more and take the pairs in the span.

    On meshes with slivers the stiffness is 1e8 times the eigenvalues, so that what rounding has left in the stiffest
    directions weighs heavily in the residual; this divides it by as much.
    """
    span = np.linalg.qr(operator(np.ascontiguousarray(evecs)))[0]
    reduced = span.T @ operator(np.ascontiguousarray(span))
    evals, mixing = np.linalg.eigh((reduced + reduced.T) / 2)
    return Pairs(evals, span @ mixing)


def _lanczos(operator: Callable[[FloatArray], FloatArray], n: int, k: int, block: int) -> Pairs:
    """Return the `k` greatest pairs of a symmetric (N, N) operator, as far as they converge in a bounded space.

    Block Lanczos from a fixed start, without restarts: a space larger than one with restarts would be costs less than
    they do, and blocks of vectors are solved for and made orthogonal at several times the speed of single ones.
    """
    limit = min(6 * k + 40 * block, n - block) // block * block
    basis = np.empty((n, limit + block), order="F")  # unused columns take no memory
    reduced = np.zeros((limit + block, limit + block))  # the operator in the basis, lower half, block tridiagonal
    basis[:, :block] = np.linalg.qr(np.random.default_rng(0).standard_normal((n, block)))[0]
    look = 2.5 * k + 17 * block - 10  # where meshes are about to converge
    for size in range(block, limit + 1, block):
        _step(operator, basis[:, : size + block], reduced, block)
        if size >= min(look, limit):
            evals, mixing = np.linalg.eigh(reduced[:size, :size])
            evals, mixing = evals[-k:], mixing[:, -k:]
            defect = np.linalg.norm(reduced[size : size + block, size - block : size] @ mixing[-block:], axis=0)
            if (defect <= _CONVERGED * np.abs(evals)).all():
                break
            look = 1.08 * size
    return Pairs(evals, basis[:, :size] @ mixing)


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
    basis[:, after], reduced[after, here] = np.linalg.qr(image)


def _fault(problem: Problem, found: Pairs) -> str:
    """Return what is wrong with the pairs, or an empty string."""
    defect = residual(problem, found)
    if not defect <= _RESIDUAL:
        return f"the relative residual is {defect:.1e}, wanted at most {_RESIDUAL:.0e}"
    error = np.abs(found.evecs.T @ found.evecs - np.eye(problem.k)).max()
    if not error <= _ORTHONORMAL:
        return f"the eigenvectors are orthonormal only to {error:.1e}"
    missing = _missing(problem, found.evals)
    return counted(missing, "eigenvalue was passed over", "eigenvalues were passed over") if missing else ""


def residual(problem: Problem, found: Pairs) -> float:
    """Return the greatest defect of a pair over the greatest eigenvalue (over the unit if that is greater)."""
    defect = np.linalg.norm(problem.matrix @ found.evecs - found.evecs * found.evals, axis=0).max()
    return float(defect / max(found.evals[-1], problem.unit))


def _missing(problem: Problem, evals: FloatArray) -> int:
    """Count the eigenvalues that `evals` should contain and does not, up to its last clear gap."""
    gaps = np.flatnonzero(np.diff(evals) > 1e-5 * max(evals[-1], problem.unit))
    if gaps.size == 0:
        return 0
    last = gaps[-1]
    bound = 0.5 * (evals[last] + evals[last + 1])
    below = int((_factor(problem.matrix, bound).U.diagonal() < 0).sum())
    return below - int(last + 1)
