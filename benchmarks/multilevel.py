"""Eigenpairs of big meshes from a coarse one against those of a factorisation: seconds and what they differ by.

    python benchmarks/multilevel.py --threads 2 --sizes 100000 300000

Both ways run in turns on one mesh, a built-in human, remeshed and subdivided.  csm itself takes the first way above
`csm.operators.operators.DIRECT_UP_TO` vertices.
"""

from __future__ import annotations

from dataclasses import dataclass
from unittest import mock

import numpy as np
from measuring import median_milliseconds, options, write
from scale import body

from csm import Operators, preset
from csm._types import FloatArray
from csm.operators import operators as operators_module
from csm.operators.spectrum import Spectrum

SIZES = (100_000, 300_000)


@dataclass(frozen=True)
class Row:
    """Seconds of both ways, and how much the results differ.

    `eigenvalues`: greatest difference, over the greatest eigenvalue (of all angles).  `descriptor`: greatest difference
    of a column in the norm of L2, over the column; for functions of the sum of their squares with Chebyshev weights.
    """

    work: str
    vertices: int
    factored_s: float
    ours_s: float
    ratio: float
    eigenvalues: float
    descriptor: float


def described(spectra: list[Spectrum]) -> FloatArray:
    """Return the columns of ACD, T_0 to T_6 of every spectrum, times the root of the vertex areas."""
    columns = []
    for spectrum in spectra:
        at = np.arccos(np.clip(2 * spectrum.evals / spectrum.evals[-1] - 1, -1, 1))
        columns.append(spectrum.evecs**2 @ np.cos(np.outer(np.arange(7), at)).T)
    return np.hstack(columns) * np.sqrt(spectra[0].mass)[:, None]


def functions(operators: Operators) -> list[Spectrum]:
    """Return 128 eigenpairs of the isotropic Laplacian."""
    return [operators.lbo(128)]


def angles(operators: Operators) -> list[Spectrum]:
    """Return the eigenpairs that `acd_paper` is made of."""
    descriptor = preset("acd_paper")
    return descriptor._spectra(operators)


def measured(work: str, n_vertices: int, repeats: int) -> Row:
    """Measure one kind of work on one mesh, both ways in turns."""
    mesh, compute = body(n_vertices), {"acd_paper": angles, "128 functions": functions}[work]
    found: dict[str, list[Spectrum]] = {}

    def run(way: str, direct_up_to: int) -> None:
        with mock.patch.object(operators_module, "DIRECT_UP_TO", direct_up_to):
            found[way] = compute(Operators(mesh))

    ways = {"factored": lambda: run("factored", 10**9), "ours": lambda: run("ours", 0)}
    taken = median_milliseconds(ways, repeats)
    direct, ours = found["factored"], found["ours"]
    values = max(float(np.abs(a.evals - b.evals).max() / b.evals[-1]) for a, b in zip(ours, direct, strict=True))
    wanted = described(direct)
    columns = np.linalg.norm(described(ours) - wanted, axis=0) / np.linalg.norm(wanted, axis=0)
    factored_s, ours_s = taken["factored"] / 1e3, taken["ours"] / 1e3
    return Row(work, mesh.n_vertices, factored_s, ours_s, factored_s / ours_s, values, float(columns.max()))


def main() -> None:
    chosen = options("multilevel", __doc__, [], repeats=1, sizes=SIZES)
    rows = []
    for n in chosen.sizes:
        for work in ("acd_paper", "128 functions"):
            rows.append(row := measured(work, n, chosen.repeats))
            print(row, flush=True)
    write("multilevel", chosen, {}, rows)


if __name__ == "__main__":
    main()
