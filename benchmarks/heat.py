"""Heat distances from many sources: what csm takes, and the solves alone that no batched way can do without.

    python benchmarks/heat.py --threads 1

csm asks potpourri3d for one source after the other.  A batched way solves for many sources at once, by the heat flow
and by Poisson's equation: "the solves alone" are these two with SciPy's factors, without the gradients and divergences
between them, and of no use by themselves.  Times are per source; the variants take turns, and the time is the median.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from measuring import median_milliseconds, options, write
from scipy import sparse
from scipy.sparse.linalg import splu

from csm import Mesh, geodesics, load_humans
from csm.operators.laplacian import stiffness, vertex_areas

SOURCES, GOAL = 64, 5.0
OURS, BOUND = "csm, one by one", "the solves alone, 64 at once"


@dataclass(frozen=True)
class Row:
    """What was measured of one variant, per source."""

    variant: str
    vertices: int
    milliseconds: float
    ratio: float
    goal: float | None


def solves(mesh: Mesh, sources: np.ndarray) -> Callable[[], object]:
    """Return a run of both solves for all sources, with factors that are made before."""
    areas, walls = sparse.diags_array(vertex_areas(mesh)), stiffness(mesh)
    edges = np.linalg.norm(mesh.corners - np.roll(mesh.corners, 1, axis=1), axis=2)
    kept = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}}
    flow, poisson = (
        splu(sparse.csc_matrix(matrix), **kept) for matrix in (areas + edges.mean() ** 2 * walls, walls + 1e-8 * areas)
    )
    heat = np.zeros((mesh.n_vertices, len(sources)), order="F")
    heat[sources, np.arange(len(sources))] = 1
    return lambda: poisson.solve(flow.solve(heat))


def main() -> None:
    chosen, mesh = options("heat", __doc__, [], repeats=7), load_humans()[0]
    sources = np.random.default_rng(0).integers(0, mesh.n_vertices, SOURCES)
    surface = geodesics(mesh, "heat")
    runs = {OURS: lambda: surface.rows(sources), BOUND: solves(mesh, sources)}
    median = {v: each / SOURCES for v, each in median_milliseconds(runs, chosen.repeats).items()}
    goals = {OURS: None, BOUND: GOAL}
    rows = [Row(v, mesh.n_vertices, each, median[OURS] / each, goals[v]) for v, each in median.items()]
    for row in rows:
        print(row)
    write("heat", chosen, {"sources": SOURCES}, rows)


if __name__ == "__main__":
    main()
