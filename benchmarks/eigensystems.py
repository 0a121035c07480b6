"""Eigensystems of descriptors and bases against the plain library call: one sparse LU and `eigsh` per Laplacian.

    python benchmarks/eigensystems.py --threads 1

The reference has the ordering that suits meshes of this size best.  Both are given the assembled operators and run in
turns; the descriptor and the eigenvalues of both are compared.
"""

from __future__ import annotations

import statistics
import time
from dataclasses import dataclass, replace

import numpy as np
from measuring import options, write
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, eigsh, splu
from threadpoolctl import threadpool_limits

from csm import ACD, Mesh, Operators, load_humans
from csm.descriptors.acd import chebyshev_block
from csm.mesh.remesh import refine
from csm.operators import Spectrum
from csm.operators.laplacian import stiffness

WORK = {"acd_paper": ACD.paper(), "acd_release": ACD.release(), "128 functions": 128, "256 functions": 256}
SIZES = (6899, 15000)


@dataclass(frozen=True)
class Row:
    """One piece of work on one mesh: medians over the repeats, and the greatest relative difference of the results."""

    work: str
    vertices: int
    reference_ms: float
    csm_ms: float
    ratio: float
    ratios: list[float]
    difference: float


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


def measured(mesh: Mesh, name: str, work: ACD | int, repeats: int) -> Row:
    times: dict[str, list[float]] = {"reference": [], "csm": []}
    found = {}
    for _ in range(repeats + 1):  # the first is not counted
        for who, run in (("reference", reference), ("csm", ours)):
            operators = Operators(mesh)
            _ = operators.mass
            if isinstance(work, ACD):
                operators.anisotropic(frame=work.frame, sweeps=work.sweeps, smoothing=work.smoothing)
            begun = time.perf_counter()
            found[who] = run(operators, work)
            times[who].append(1e3 * (time.perf_counter() - begun))
    a, b = (times[who][1:] for who in ("reference", "csm"))
    ratios = [x / y for x, y in zip(a, b, strict=True)]
    difference = np.abs(found["csm"] - found["reference"]).max() / np.abs(found["reference"]).max()
    middle = statistics.median
    return Row(name, mesh.n_vertices, middle(a), middle(b), middle(ratios), sorted(ratios), float(difference))


def main() -> None:
    chosen = options("eigensystems", __doc__, list(WORK), repeats=5)
    human = load_humans()[0]
    rows = []
    with threadpool_limits(chosen.threads):
        for n in SIZES:
            mesh = human if n == human.n_vertices else refine(human, n, 0).mesh
            for name, work in WORK.items():
                rows.append(row := measured(mesh, name, work, chosen.repeats))
                print(
                    f"{n:6d} vertices  {name:14s} reference {row.reference_ms:7.0f} ms  csm {row.csm_ms:7.0f} ms  "
                    f"ratio {row.ratio:.2f} ({row.ratios[0]:.2f} to {row.ratios[-1]:.2f})  "
                    f"differ by {row.difference:.0e}"
                )
    write("eigensystems", chosen, {}, rows)


if __name__ == "__main__":
    main()
