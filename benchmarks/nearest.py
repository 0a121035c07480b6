"""Time and memory of the nearest neighbours in descriptor space against PyTorch's and SciPy's, all in this run.

    python benchmarks/nearest.py --threads 1

One pass finds the neighbours of 15,000 vertices among 6,890 by descriptors of a trained network's width, smooth along
the surface; one row in twenty has a near copy, as left and right of a body do.  "of the products" is the share of the
speed of the matrix products alone, which no search of this kind can do without.  The variants take turns; the time is
the median, the ratio the reference's time over the variant's.  Peak memory is what a fresh process needs beyond its
inputs.  A match is wrong if it is farther than the nearest row by float64 differences (relative 1e-9, so that ties
count as right).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
import torch
from measuring import growth_megabytes, median_milliseconds, options, peak_megabytes, seconds, write
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist
from torch.nn import functional as F

from csm.matching.nearest import nearest

QUERIES, N, D = 15_000, 6890, 256
MANY, GOAL = 1_000_000, 0.8
BLOCK = 512
REFERENCE, PRODUCT, OURS, OURS_MANY = "torch.cdist + argmin", "the products alone", "csm nearest", "csm nearest of many"
FREQUENCY, NEAR_COPIES = 8.0, N // 20

Rows = NDArray[np.float32]
Matcher = Callable[[Rows, Rows], NDArray[np.int64]]


@dataclass(frozen=True)
class Row:
    """What was measured of one variant."""

    variant: str
    queries: int
    milliseconds: float
    speedup: float | None
    of_products: float | None
    goal: float | None
    megabytes: float
    wrong: float | None


def by_cdist(queries: Rows, candidates: Rows) -> NDArray[np.int64]:
    return torch.cdist(torch.from_numpy(queries), torch.from_numpy(candidates)).argmin(1).numpy()


def by_tree(queries: Rows, candidates: Rows) -> NDArray[np.int64]:
    return cKDTree(candidates).query(queries, workers=torch.get_num_threads())[1]


def product_alone(queries: Rows, candidates: Rows) -> NDArray[np.int64]:
    """Return nothing of use: the products of all rows, in blocks, are what a search by products cannot do without."""
    q, c = torch.from_numpy(queries), torch.from_numpy(candidates).T
    block = torch.empty(BLOCK, len(candidates))
    for part in q.split(BLOCK):
        torch.mm(part, c, out=block[: len(part)])
    return np.zeros(len(queries), np.int64)


VARIANTS: dict[str, Matcher] = {
    REFERENCE: by_cdist,
    "scipy cKDTree": by_tree,
    PRODUCT: product_alone,
    OURS: nearest,
}


def problem(n_queries: int = QUERIES) -> list[Rows]:
    """Return two shapes' descriptors, rows of D: one smooth function of the sphere at two samples of its points."""
    torch.manual_seed(0)
    waves, phases = FREQUENCY * torch.randn(3, D), 2 * torch.pi * torch.rand(D)
    shapes = []
    for n in (n_queries, N):
        points = F.normalize(torch.randn(n, 3))
        points[:NEAR_COPIES] = points[-NEAR_COPIES:] + 1e-5 * torch.randn(NEAR_COPIES, 3)
        shapes.append(torch.addmm(phases, points, waves).cos_().numpy())
    return shapes


def wrong(found: NDArray[np.int64], queries: Rows, candidates: Rows) -> float:
    """Return the fraction of queries with a nearer candidate than the one found."""
    q, c = queries.astype(np.float64), candidates.astype(np.float64)
    least = np.concatenate([cdist(part, c).min(1) for part in np.array_split(q, 16)])
    return float((np.linalg.norm(q - c[found], axis=1) > least * (1 + 1e-9)).mean())


def own_peak(variant: str) -> float:
    """Return what one pass needs; a tiny pass first loads the libraries."""
    queries, candidates = problem(MANY if variant == OURS_MANY else QUERIES)
    search = VARIANTS.get(variant, nearest)
    search(queries[:8], candidates[:8])
    return growth_megabytes(lambda: search(queries, candidates))


def measure(repeats: int, threads: int) -> list[Row]:
    # First, while this process is small: on Linux a child starts with its parent's peak.
    peaks = {variant: peak_megabytes(variant, threads) for variant in (*VARIANTS, OURS_MANY)}
    queries, candidates = problem()
    errors = {variant: wrong(match(queries, candidates), queries, candidates) for variant, match in VARIANTS.items()}
    median = median_milliseconds({v: partial(match, queries, candidates) for v, match in VARIANTS.items()}, repeats)
    rows = [
        Row(
            v,
            QUERIES,
            median[v],
            median[REFERENCE] / median[v],
            median[PRODUCT] / median[v],
            GOAL if v == OURS else None,
            peaks[v],
            None if v == PRODUCT else errors[v],
        )
        for v in VARIANTS
    ]
    many = partial(nearest, *problem(MANY))
    return [*rows, Row(OURS_MANY, MANY, 1e3 * seconds(many), None, None, None, peaks[OURS_MANY], None)]


def main() -> None:
    chosen = options("nearest", __doc__, [*VARIANTS, OURS_MANY], repeats=7)
    if chosen.peak_of:
        print(own_peak(chosen.peak_of))
        return
    rows = measure(chosen.repeats, chosen.threads)
    print(f"{N} candidates, {D} channels, {chosen.threads} threads, median of {chosen.repeats}\n")
    for row in rows:
        print(row)
    write("nearest", chosen, {"n": N, "d": D}, rows)


if __name__ == "__main__":
    main()
