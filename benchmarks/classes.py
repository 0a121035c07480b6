"""Memory of a step of training against the number of points of the template, which are its classes.

    python benchmarks/classes.py --threads 2

One step is that of `benchmarks/step.py`, on a made-up surface of as many vertices as there are classes; peak memory is
what weights, optimiser and two steps need in a fresh process beyond the libraries.  Logits: what the N x N scores in
float32 that PyTorch's own loss keeps would take alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from measuring import growth_megabytes, options, peak_megabytes, write
from step import BASIS, OURS, made

from csm.networks import Surface
from csm.networks.basis import Basis

SIZES = (6890, 20_000, 50_000)
GOALS = {50_000: 2000.0}


@dataclass(frozen=True)
class Row:
    """What was measured of one variant at one number of classes; sizes are megabytes."""

    variant: str
    classes: int
    megabytes: float
    logits: float
    goal: float | None


def made_up(n: int) -> Surface:
    """Return a surface of `n` vertices with random numbers for its eigenfunctions."""
    evecs = torch.randn(n, BASIS) / n**0.5
    return Surface(Basis(torch.linspace(0, 1, BASIS), evecs, torch.full((n,), 1 / n)))


def two_steps(variant: str, n: int) -> None:
    step = made(made_up(n), n)
    for _ in range(2):  # the optimiser makes its state in the first
        step.take(variant)


def main() -> None:
    every = {f"{variant}, {n}": (variant, n) for n in SIZES for variant in OURS}
    chosen = options("classes", __doc__, list(every), repeats=1)
    if chosen.peak_of:
        variant, n = every[chosen.peak_of]
        two_steps(variant, 100)  # loads the libraries
        print(growth_megabytes(lambda: two_steps(variant, n)))
        return
    rows = [
        Row(variant, n, peak_megabytes(name, chosen.threads), 4e-6 * n * n, GOALS.get(n))
        for name, (variant, n) in every.items()
    ]
    for row in rows:
        print(f"{row.variant:<24}{row.classes:>8}{row.megabytes:>10.0f} MB, logits {row.logits:.0f}")
    write("classes", chosen, {}, rows)


if __name__ == "__main__":
    main()
