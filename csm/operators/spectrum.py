"""The generalised eigenproblem  S phi = lambda diag(mass) phi  of a mesh Laplacian, solved and checked."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy import sparse
from threadpoolctl import ThreadpoolController

from csm._counts import counted
from csm._types import FloatArray
from csm.errors import ConfigError, MeshError, NumericalError
from csm.operators._eigensolver import Pairs, Problem, attempt_once, attempts
from csm.operators._factors import Factors

_log = logging.getLogger(__name__)

_ZERO = 1e-8  # eigenvalues below this over the area are zero but for rounding


@dataclass(frozen=True, eq=False)
class Spectrum:
    """The K smallest eigenpairs of a Laplacian, checked.

    Attributes
    ----------
    evals
        Shape (K,), ascending, at least 0, and exactly 0 for functions that are constant on components; in units of
        1/area (the inverse square of the mesh's unit of length).
    evecs
        Shape (N, K), orthonormal with respect to `mass`; of each, the first entry of greatest magnitude is positive.
    mass
        Shape (N,), the vertex areas.
    residual
        Greatest of |S phi - lambda M phi| over the K pairs, in the norm of the inverse mass, divided by lambda_K (by
        1/area if that is greater).
    notes
        What happened that a careful reader would want to know, such as a second attempt.
    name
        What messages call the mesh.
    """

    evals: FloatArray
    evecs: FloatArray
    mass: FloatArray
    residual: float
    notes: tuple[str, ...] = ()
    name: str = ""

    def __repr__(self) -> str:
        return f"Spectrum({self.name!r}, {counted(len(self.evals), 'eigenpair')}, {counted(len(self.mass), 'vertex')})"

    def first(self, k: int) -> Spectrum:
        """Return the `k` smallest pairs of these; ConfigError if there are fewer."""
        if not 1 <= k <= len(self.evals):
            raise ConfigError(f"asked for the first {k} of {len(self.evals)} eigenpairs; compute more of them")
        return replace(self, evals=self.evals[:k], evecs=self.evecs[:, :k])

    def n_zero(self) -> int:
        """Number of zero eigenvalues (below 1e-8 over the area): one per component of the mesh.

        Raises
        ------
        NumericalError
            If all are zero, because the mesh has at least K components; ask for more pairs.
        """
        count = int(np.searchsorted(self.evals, _ZERO / self.mass.sum()))
        if count == len(self.evals):
            raise NumericalError(
                f"{self.name or 'the mesh'}: all {count} eigenvalues are zero, one per component; ask for more of "
                "them, join the components, or keep the largest alone (csm clean IN OUT debris=0.9)"
            )
        return count


def eigenpairs(
    stiffness: sparse.csr_array,
    mass: FloatArray,
    k: int,
    *,
    name: str = "mesh",
    density: float = 1.0,
    factors: Factors | None = None,
) -> Spectrum:
    """Return the `k` smallest eigenpairs of  S phi = lambda diag(mass) phi.

    Shift-invert Lanczos from a fixed start on one BLAS thread, or a dense solver for small meshes.  The answer is
    accepted only if residuals and orthonormality hold (where slivers make the matrix so stiff that rounding alone
    leaves more, the residual of the inverse) and no eigenvalue was passed over (Sylvester's law of inertia: the signs
    of a factorisation count the eigenvalues below a bound).  Single Lanczos vectors pass over copies of an eigenvalue,
    so blocks of them follow where the count says so; if those fail, it is tried again, at most twice, which
    `Spectrum.notes` records.

    Parameters
    ----------
    stiffness
        Symmetric positive semidefinite, (N, N); several components and boundaries are fine.
    mass
        Positive vertex areas, shape (N,).
    k
        Number of pairs, from 1 to N.
    name
        The mesh's name in messages.
    density
        How many eigenvalues there are below a bound, over as many as the isotropic Laplacian has by Weyl's law: a guess
        that saves time, not a result.
    factors
        For matrices of this pattern, so that its analysis is not made again; not for two threads at once.

    Raises
    ------
    ConfigError
        If `k` is not between 1 and N.
    MeshError
        If a vertex has no area or the matrix is not finite.
    NumericalError
        If no attempt passed the checks.
    """
    require_solvable(stiffness, mass, k, name)
    scale = 1.0 / np.sqrt(mass)
    matrix, unit = symmetrised(stiffness, scale), 1.0 / mass.sum()
    problem = Problem(matrix, k, unit, 4 * np.pi * k * unit / density, factors or Factors(matrix))
    with _blas().limit(limits=1):
        found, notes = _solved(problem, name)
    return finished(found, mass, scale, notes)


def _solved(problem: Problem, name: str) -> tuple[Pairs, tuple[str, ...]]:
    """Return the pairs of the first attempt that passes the checks, and notes of those before."""
    notes: list[str] = []
    for attempt in attempts(problem):
        found, fault = attempt_once(problem, attempt)
        if found is not None:
            return found, tuple(notes)
        said = f"{problem.k} eigenpairs by {attempt.method}: {fault}"
        if attempt.block == 1:  # a shape with symmetries has copies of eigenvalues: nothing is wrong with it
            _log.debug("%s: %s", name, said)
        else:
            _log.warning("%s: %s", name, said)
            notes.append(said)
    raise NumericalError(f"{name}: no attempt gave sound eigenpairs ({'; '.join(notes)}); run `csm check` on the mesh")


@cache
def _blas() -> ThreadpoolController:
    return ThreadpoolController()  # listing the loaded libraries takes milliseconds, so once


def require_solvable(stiffness: sparse.csr_array, mass: FloatArray, k: int, name: str) -> None:
    """Raise what `eigenpairs` raises before it begins."""
    n = len(mass)
    if stiffness.shape != (n, n):
        raise ConfigError(f"{name}: the stiffness has shape {stiffness.shape}, but there are {n} masses")
    if not 1 <= k <= n:
        raise ConfigError(
            f"{name}: asked for {counted(k, 'eigenpair')}, but {counted(n, 'vertex has', 'vertices have')} {n}; ask "
            f"for 1 to {n}, or take a finer mesh"
        )
    if not (np.isfinite(stiffness.data).all() and np.isfinite(mass).all()):
        raise MeshError(f"{name}: the Laplacian has entries that are not finite; run `csm check` on the mesh")
    without = np.flatnonzero(mass <= 0)
    if without.size:
        raise MeshError(
            f"{name}: {counted(without.size, 'vertex has', 'vertices have')} no area around them (the first is vertex "
            f"{without[0]}), so the eigenproblem has no answer; remove vertices that belong to no face with area"
        )


def finished(found: Pairs, mass: FloatArray, scale: FloatArray, notes: tuple[str, ...] = ()) -> Spectrum:
    """Return the spectrum of a mesh from the pairs of its symmetric matrix (`symmetrised`), whose arrays it takes."""
    evals = np.where(found.evals < _ZERO / mass.sum(), 0.0, found.evals)
    found.evecs[:] *= scale[:, None]
    return Spectrum(evals, _with_fixed_signs(found.evecs), mass, found.residual, notes)


def symmetrised(stiffness: sparse.csr_array, scale: FloatArray) -> sparse.csc_array:
    """Return M^-1/2 S M^-1/2, whose eigenvalues are those of the generalised problem; rows and columns are the same."""
    stiffness.sort_indices()
    data = stiffness.data * np.repeat(scale, np.diff(stiffness.indptr)) * scale[stiffness.indices]
    return sparse.csc_array((data, stiffness.indices, stiffness.indptr), shape=stiffness.shape)


def _with_fixed_signs(evecs: FloatArray) -> FloatArray:
    for column in evecs.T:  # one by one: a copy of all may be too large
        magnitude = np.abs(column)
        if column[np.argmax(magnitude >= magnitude.max() * (1 - 1e-6))] < 0:
            column *= -1
    return evecs
