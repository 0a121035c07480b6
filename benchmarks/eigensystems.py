"""Eigensystems of descriptors and bases against the plain library call: one sparse LU and `eigsh` per Laplacian.

    python benchmarks/eigensystems.py --threads 1

The reference has the ordering that suits meshes of this size best.  Both are given the assembled operators and run in
turns; the descriptor and the eigenvalues of both are compared.  The last work, csm's own setting of ACD, is measured
against csm's time for `acd_paper`, which it may exceed by a fifth.  Several threads share the angles of a descriptor;
the reference is given as many, for what SciPy makes of them.

Where csm's time goes is found in one more pass on one thread: the factorisation about which the matrix is inverted, the
solves with its factors, and the checks, most of which is the factorisation that counts the eigenvalues.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any
from unittest import mock

import numpy as np
from measuring import options, write
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, eigsh, splu
from threadpoolctl import threadpool_limits

from csm import ACD, Mesh, Operators, load_humans
from csm.descriptors.acd import chebyshev_block
from csm.mesh.remesh import refine
from csm.operators import Spectrum, _eigensolver
from csm.operators._factors import Factors
from csm.operators.laplacian import stiffness

WORK = {"acd_paper": ACD.paper(), "acd_release": ACD.release(), "128 functions": 128, "256 functions": 256}
OWN = "acd, against acd_paper"
GOALS = {
    "acd_paper": (3.0, 5.5),
    "acd_release": (2.5, 4.5),
    "128 functions": (2.0, None),
    "256 functions": (2.0, None),
    OWN: (1 / 1.2, 1 / 1.2),
}
"""The ratios that csm set itself, on one thread and on two."""
SIZES = (6899, 15000)


@dataclass(frozen=True)
class Row:
    """One piece of work on one mesh: medians over the repeats, and the greatest relative difference of the results.

    The difference is None where the reference computes something else.  Shares are of csm's time, in percent.
    """

    work: str
    vertices: int
    reference_ms: float
    csm_ms: float
    ratio: float
    goal: float | None
    ratios: list[float]
    difference: float | None
    factor_share: float
    solve_share: float
    check_share: float


def reference(operators: Operators, work: ACD | int) -> np.ndarray:
    """Return the descriptor or the eigenvalues as a few lines of SciPy compute them."""
    if isinstance(work, int):
        return plain(stiffness(operators.mesh), operators.mass, work).evals
    all_angles = operators.anisotropic(frame=work.frame, sweeps=work.sweeps, smoothing=work.smoothing)
    spectra = [plain(all_angles.at(work.alpha, theta), operators.mass, work.k) for theta in work.thetas]
    return np.hstack([chebyshev_block(spectrum, work.order) for spectrum in spectra])


def plain(matrix: sparse.csr_array, mass: np.ndarray, k: int) -> Spectrum:
    scale = sparse.diags_array(1 / np.sqrt(mass))
    symmetric = sparse.csc_array(scale @ matrix @ scale)
    shifted = symmetric + sparse.eye_array(len(mass))  # the area is 1, and so is the natural unit of eigenvalues
    factors = splu(sparse.csc_array(shifted), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
    inverse = LinearOperator(symmetric.shape, matvec=factors.solve, dtype=np.float64)
    evals, evecs = eigsh(symmetric, k, sigma=-1.0, OPinv=inverse)
    order = np.argsort(evals)
    return Spectrum(np.maximum(evals[order], 0), scale @ evecs[:, order], mass, 0.0)


def ours(operators: Operators, work: ACD | int) -> np.ndarray:
    """Return the same from operators without any spectrum."""
    if isinstance(work, int):
        return operators.lbo(work).evals
    return replace(work, normalise=False)(operators).values


def prepared(mesh: Mesh, work: ACD | int) -> Operators:
    """Return new operators with what both sides are given: the areas and the assembled parts of the Laplacian."""
    operators = Operators(mesh)
    _ = operators.mass
    if isinstance(work, ACD):
        operators.anisotropic(frame=work.frame, sweeps=work.sweeps, smoothing=work.smoothing)
    return operators


def shares(mesh: Mesh, work: ACD | int) -> dict[str, float]:
    """Return the percentages of csm's time on one thread that its parts take."""
    spent = {"factor": 0.0, "solve": 0.0, "check": 0.0}

    def timed(part: str, run: Callable[..., Any]) -> Callable[..., Any]:
        def wrapped(*given: Any) -> Any:
            begun = time.perf_counter()
            found = run(*given)
            spent[part] += time.perf_counter() - begun
            return found

        return wrapped

    solve = timed("solve", Factors.solve)
    fault, begin = timed("check", _eigensolver._fault), timed("factor", _eigensolver._factored)
    operators = prepared(mesh, work)
    begun = time.perf_counter()
    with (
        threadpool_limits(1),
        mock.patch.object(_eigensolver, "_fault", fault),
        mock.patch.object(_eigensolver, "_factored", begin),
        mock.patch.object(Factors, "solve", lambda self, columns: solve(self, columns)),
    ):
        ours(operators, work)
    whole = time.perf_counter() - begun
    return {f"{part}_share": 100 * taken / whole for part, taken in spent.items()}


def measured(mesh: Mesh, name: str, repeats: int, threads: int) -> Row:
    work = ACD() if name == OWN else WORK[name]
    runs = ((ours, WORK["acd_paper"]), (ours, work)) if name == OWN else ((reference, work), (ours, work))
    times, found = ([], []), [np.zeros(0), np.zeros(0)]
    for _ in range(repeats + 1):  # the first is not counted
        for who, (run, what) in enumerate(runs):
            operators = prepared(mesh, what)
            begun = time.perf_counter()
            found[who] = run(operators, what)
            times[who].append(1e3 * (time.perf_counter() - begun))
    a, b = (each[1:] for each in times)
    ratios = [x / y for x, y in zip(a, b, strict=True)]
    difference = None if name == OWN else float(np.abs(found[1] - found[0]).max() / np.abs(found[0]).max())
    middle, goal = statistics.median, GOALS[name][threads - 1] if threads <= 2 else None
    return Row(
        name,
        mesh.n_vertices,
        middle(a),
        middle(b),
        middle(ratios),
        goal,
        sorted(ratios),
        difference,
        **shares(mesh, work),
    )


def main() -> None:
    chosen = options("eigensystems", __doc__, list(WORK), repeats=5)
    human = load_humans()[0]
    rows = []
    with threadpool_limits(chosen.threads):
        for n in SIZES:
            mesh = human if n == human.n_vertices else refine(human, n, 0).mesh
            for name in (*WORK, OWN):
                rows.append(row := measured(mesh, name, chosen.repeats, chosen.threads))
                print(
                    f"{n:6d} vertices  {name:22s} reference {row.reference_ms:7.0f} ms  csm {row.csm_ms:7.0f} ms  "
                    f"ratio {row.ratio:.2f} ({row.ratios[0]:.2f} to {row.ratios[-1]:.2f})  "
                    f"differ by {row.difference}; factor {row.factor_share:.0f} %, solve {row.solve_share:.0f} %, "
                    f"check {row.check_share:.0f} %"
                )
    write("eigensystems", chosen, {}, rows)


if __name__ == "__main__":
    main()
