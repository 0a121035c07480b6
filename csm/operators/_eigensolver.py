"""Attempts at a symmetric sparse eigenproblem, and the checks that decide whether one is believed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import ArpackError, LinearOperator, SuperLU, eigsh, splu

from csm._types import FloatArray

_DENSE_BELOW = 400  # rows; smaller problems, and those for more than a third of the spectrum, are solved densely
_RESIDUAL = 1e-7
_ORTHONORMAL = 1e-8


class Problem(NamedTuple):
    """Find the `k` smallest eigenpairs of a symmetric matrix."""

    matrix: sparse.csc_array  # (N, N)
    k: int
    unit: float  # natural unit of its eigenvalues, 1 / area


class Attempt(NamedTuple):
    """One way to solve it; without Lanczos vectors (ncv = 0) densely."""

    method: str
    shift: float
    ncv: int


class Pairs(NamedTuple):
    """Eigenvalues, ascending, and orthonormal eigenvectors."""

    evals: FloatArray  # (K,)
    evecs: FloatArray  # (N, K)


def attempts(problem: Problem) -> tuple[Attempt, ...]:
    """Return the ways to try, best first."""
    n, k = problem.matrix.shape[0], problem.k
    if n < _DENSE_BELOW or k > n // 3:
        return (Attempt("the dense solver", 0.0, 0),)
    shift = -1e-2 * problem.unit
    return (
        Attempt("shift-invert", shift, max(2 * k + 1, 20)),
        Attempt("shift-invert in a larger space", shift, min(4 * k + 20, n - 1)),
        Attempt("shift-invert with a larger shift", 100 * shift, min(6 * k + 20, n - 1)),
    )


def attempt_once(problem: Problem, attempt: Attempt) -> tuple[Pairs | None, str]:
    """Return the pairs if they are sound, else None and what is wrong."""
    try:
        found = _solve(problem, attempt)
        fault = _fault(problem, found)
    except (ArpackError, RuntimeError, np.linalg.LinAlgError) as error:
        return None, str(error)
    return (None, fault) if fault else (found, "")


def _factor(symmetric: sparse.csc_array, shift: float) -> SuperLU:
    """Factor  symmetric - shift I  with diagonal pivots: U's diagonal has a negative entry per eigenvalue below."""
    shifted = sparse.csc_array(symmetric - shift * sparse.eye_array(symmetric.shape[0]))
    return splu(shifted, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})


def _solve(problem: Problem, attempt: Attempt) -> Pairs:
    matrix, k = problem.matrix, problem.k
    if attempt.ncv == 0:
        evals, evecs = np.linalg.eigh(matrix.toarray())
        return Pairs(evals[:k], evecs[:, :k])
    n = matrix.shape[0]
    inverse = LinearOperator((n, n), matvec=_factor(matrix, attempt.shift).solve, dtype=np.float64)
    start = np.random.default_rng(0).standard_normal(n)
    evals, evecs = eigsh(matrix, k, sigma=attempt.shift, OPinv=inverse, v0=start, ncv=attempt.ncv)
    order = np.argsort(evals)
    return Pairs(evals[order], evecs[:, order])


def _fault(problem: Problem, found: Pairs) -> str:
    """Return what is wrong with the pairs, or an empty string."""
    defect = residual(problem, found)
    if not defect <= _RESIDUAL:
        return f"the relative residual is {defect:.1e}, wanted at most {_RESIDUAL:.0e}"
    error = np.abs(found.evecs.T @ found.evecs - np.eye(problem.k)).max()
    if not error <= _ORTHONORMAL:
        return f"the eigenvectors are orthonormal only to {error:.1e}"
    missing = _missing(problem, found.evals)
    return f"{missing} eigenvalues were passed over" if missing else ""


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
