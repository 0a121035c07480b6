"""Exact distances of single pairs against whole rows, on one target of a simulated evaluation.

    python benchmarks/geodesic.py tr_reg_080.off

Simulates the matches of 19 source shapes: 60 % exact, 38 % off by one to three edges, 2 % on a far part of the body
(anywhere, or always the same few patches, as left-right flips are).  Times are of the processor, one thread; the
reference is one whole row per missed vertex, extrapolated from 20 rows measured in the same run.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np
from scipy.sparse import coo_array

from csm.mesh.io import read_mesh
from csm.mesh.shape import Mesh
from csm.operators.geodesic import geodesics

N_SOURCES, NEAR, FAR, N_REFERENCE = 19, 0.38, 0.02, 20


def seconds(run: Callable[[], object]) -> float:
    started = time.process_time()
    run()
    return time.process_time() - started


def stepper(mesh: Mesh, rng: np.random.Generator) -> Callable[[np.ndarray], np.ndarray]:
    """Return a function that moves vertices along a random edge each."""
    a, b = mesh.faces[:, [0, 1, 2]].ravel(), mesh.faces[:, [1, 2, 0]].ravel()
    graph = coo_array((np.ones(2 * len(a)), (np.r_[a, b], np.r_[b, a])), shape=(mesh.n_vertices,) * 2).tocsr()
    degree = np.diff(graph.indptr)
    return lambda v: graph.indices[graph.indptr[v] + (rng.random(len(v)) * degree[v]).astype(int)]


def simulate(mesh: Mesh, far_fraction: float, patches: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return missed vertices and their matches, all sources together."""
    rng = np.random.default_rng(0)
    step, n, pairs = stepper(mesh, rng), mesh.n_vertices, []
    size = round(far_fraction * n)
    by_distance = [np.argsort(((mesh.vertices - mesh.vertices[c]) ** 2).sum(1))[:size] for c in rng.integers(0, n, 10)]
    for _ in range(N_SOURCES):
        match, draw = np.arange(n), rng.random(n)
        for i in range(3):
            moving = (draw < NEAR) & (rng.integers(1, 4, n) > i)
            match[moving] = step(match[moving])
        one, other = rng.choice(10, 2, replace=False) if patches else (0, 0)
        lost = by_distance[one] if patches else rng.choice(n, size, replace=False)
        match[lost] = rng.permutation(by_distance[other]) if patches else rng.integers(0, n, size)
        pairs.append(np.stack([np.arange(n), match]))
    truth, match = np.concatenate(pairs, axis=1)
    return truth[truth != match], match[truth != match]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("mesh", help="a target shape")
    mesh = read_mesh(parser.parse_args().mesh)
    surface = geodesics(mesh, "exact")
    sample = np.random.default_rng(1).integers(0, mesh.n_vertices, N_REFERENCE)
    per_row = seconds(lambda: surface.rows(sample)) / N_REFERENCE
    print(f"{mesh}: {per_row:.3f} s per row, diameter {seconds(surface.diameter):.2f} s")
    for title, far, patches in (
        ("near misses only", 0.0, False),
        ("and 2 % far, in patches", FAR, True),
        ("and 2 % far, anywhere", FAR, False),
    ):
        truth, match = simulate(mesh, far, patches)
        found = np.empty(0)

        def run(truth: np.ndarray = truth, match: np.ndarray = match) -> None:
            nonlocal found
            found = surface.pairs(truth, match)

        took, reference = seconds(run), per_row * len(np.unique(truth))
        check = np.random.default_rng(2).choice(len(truth), 5)
        error = np.abs(surface.rows(truth[check])[np.arange(5), match[check]] - found[check]).max()
        print(
            f"{title}: {len(truth)} pairs in {took:.1f} s, whole rows {reference:.0f} s, ratio {took / reference:.4f}; "
            f"20 targets {20 * took / 60:.1f} min; largest difference from rows {error:.1e}"
        )


if __name__ == "__main__":
    main()
