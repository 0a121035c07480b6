"""Eigenpairs and frames of big meshes with a coarse grid against factorisations: seconds and what they differ by.

    python benchmarks/multilevel.py --threads 2 --sizes 100000 300000

Both ways run in turns on one mesh, a built-in human, remeshed and subdivided.  csm itself factors up to
`csm.operators.operators.DIRECT_UP_TO` vertices, and for smooth frames up to `csm.operators.linefield._FACTORED` faces.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from types import ModuleType
from typing import Any
from unittest import mock

import numpy as np
from measuring import median_milliseconds, options, write
from scale import body

from csm import Mesh, Operators, preset
from csm._types import FloatArray
from csm.descriptors.acd import chebyshev_block
from csm.operators import linefield
from csm.operators import operators as operators_module
from csm.operators.spectrum import Spectrum

SIZES = (100_000, 300_000)


@dataclass(frozen=True)
class Row:
    """Seconds of both ways, and how much the results differ.

    `eigenvalues`: greatest difference, over the greatest eigenvalue (of all angles).  `descriptor`: greatest difference
    of a column in the norm of L2, over the column; for functions of the sum of their squares with Chebyshev weights; of
    frames the greatest difference of a face's line, which has a length of at most 1.
    """

    work: str
    vertices: int
    factored_s: float
    ours_s: float
    ratio: float
    eigenvalues: float | None
    descriptor: float


def described(spectra: list[Spectrum]) -> FloatArray:
    """Return the columns of ACD, T_0 to T_6 of every spectrum, times the root of the vertex areas."""
    return np.hstack([chebyshev_block(spectrum, 6) for spectrum in spectra]) * np.sqrt(spectra[0].mass)[:, None]


def functions(operators: Operators) -> list[Spectrum]:
    """Return 128 eigenpairs of the isotropic Laplacian."""
    return [operators.lbo(128)]


def angles(operators: Operators) -> list[Spectrum]:
    """Return the eigenpairs that `acd_paper` is made of."""
    descriptor = preset("acd_paper")
    return descriptor._spectra(operators)


def in_turns(module: ModuleType, limit: str, compute: Callable[[], Any], repeats: int) -> tuple[list[float], list[Any]]:
    """Return seconds and results of computing something factored and then not, by a limit of a module's."""
    found: dict[str, Any] = {}

    def run(way: str, value: int) -> None:
        with mock.patch.object(module, limit, value):
            found[way] = compute()

    taken = median_milliseconds({"factored": lambda: run("factored", 10**9), "ours": lambda: run("ours", 0)}, repeats)
    return [taken[way] / 1e3 for way in ("factored", "ours")], [found[way] for way in ("factored", "ours")]


def of_spectra(work: str, mesh: Mesh, repeats: int) -> Row:
    """Measure one kind of spectra."""
    compute = {"acd_paper": angles, "128 functions": functions}[work]
    (factored, ours), (wanted, found) = in_turns(
        operators_module, "DIRECT_UP_TO", lambda: compute(Operators(mesh)), repeats
    )
    values = max(float(np.abs(a.evals - b.evals).max() / b.evals[-1]) for a, b in zip(found, wanted, strict=True))
    columns = described(wanted)
    errors = np.linalg.norm(described(found) - columns, axis=0) / np.linalg.norm(columns, axis=0)
    return Row(work, mesh.n_vertices, factored, ours, factored / ours, values, float(errors.max()))


def of_frames(mesh: Mesh, repeats: int) -> Row:
    """Measure smooth frames, which `acd` and csm's own network have."""
    compute = partial(linefield.smooth_line_field, mesh, 0.08)
    (factored, ours), (wanted, found) = in_turns(linefield, "_FACTORED", compute, repeats)
    return Row(
        "smooth frames", mesh.n_vertices, factored, ours, factored / ours, None, float(abs(found - wanted).max())
    )


def main() -> None:
    chosen = options("multilevel", __doc__, [], repeats=1, sizes=SIZES)
    rows = []
    for n in chosen.sizes:
        mesh = body(n)
        for row in (
            of_frames(mesh, chosen.repeats),
            of_spectra("acd_paper", mesh, chosen.repeats),
            of_spectra("128 functions", mesh, chosen.repeats),
        ):
            rows.append(row)
            print(row, flush=True)
    write("multilevel", chosen, {}, rows)


if __name__ == "__main__":
    main()
