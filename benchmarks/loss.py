"""Time and memory of the chunked classifier loss against PyTorch's own, both measured in this run.

    python benchmarks/loss.py --threads 2

One pass is loss and gradients of ``linear_cross_entropy`` or of ``F.linear`` with ``F.cross_entropy`` at the size of a
FAUST shape.  The variants take turns, so that a busy machine slows all of them; the time is the median, the ratio the
reference's time over the variant's.  Peak memory is what a fresh process needs beyond its inputs.
"""

from __future__ import annotations

import argparse
import json
import resource
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import torch
from torch import Tensor
from torch.nn import functional as F

from csm.evaluation.provenance import provenance
from csm.learning.loss import linear_cross_entropy
from csm.mesh.io import atomic_path

N, D = 6890, 256
REFERENCE = "F.linear + F.cross_entropy"
CHUNKED = {f"{products}, chunk {c}": (products, c) for products in ("float32", "bfloat16") for c in (128, 512, 2048)}
VARIANTS = [REFERENCE, *CHUNKED]

Problem = tuple[Tensor, Tensor, Tensor, Tensor]


@dataclass(frozen=True)
class Row:
    """What was measured of one variant."""

    variant: str
    milliseconds: float
    speedup: float
    megabytes: float
    loss_error: float
    gradient_error: float


@dataclass(frozen=True)
class Pass:
    """Loss and gradients with respect to x, weight and bias."""

    loss: Tensor
    gradients: tuple[Tensor, ...]


def problem() -> Problem:
    """Return x (N, D), weight (N, D), bias (N,) and target (N,), as at the start of a training."""
    torch.manual_seed(0)
    x, weight = torch.randn(N, D).relu_(), torch.randn(N, D) / D**0.5
    return x.requires_grad_(), weight.requires_grad_(), torch.zeros(N, requires_grad=True), torch.randperm(N)


def one_pass(variant: str, given: Problem) -> Pass:
    *inputs, target = given
    if variant == REFERENCE:
        loss = F.cross_entropy(F.linear(*inputs), target)
    else:
        products, chunk = CHUNKED[variant]
        loss = linear_cross_entropy(*inputs, target, chunk=chunk, products=products)  # type: ignore[arg-type]
    return Pass(loss.detach(), torch.autograd.grad(loss, inputs))


def relative(found: Tensor, wanted: Tensor) -> float:
    return float((found - wanted).norm() / wanted.norm())


def seconds(run: Callable[[], object]) -> float:
    started = time.perf_counter()
    run()
    return time.perf_counter() - started


def peak_megabytes(variant: str, threads: int) -> float:
    """Measure in a fresh process, as the peak of a process never falls."""
    words = [sys.executable, __file__, "--threads", str(threads), "--peak-of", variant]
    return float(subprocess.run(words, check=True, capture_output=True, text=True).stdout)


def growth_megabytes(variant: str) -> float:
    """Return by how much one pass raises the peak of this process; a tiny pass first loads the libraries."""
    given = problem()
    one_pass(variant, (given[0][:8], given[1][:8], given[2][:8], torch.arange(8)))
    unit = 2**20 if sys.platform == "darwin" else 2**10
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    one_pass(variant, given)
    return (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / unit


def measure(repeats: int, threads: int) -> list[Row]:
    # First, while this process is small: on Linux a child starts with its parent's peak.
    peaks = {variant: peak_megabytes(variant, threads) for variant in VARIANTS}
    given = problem()
    results = {variant: one_pass(variant, given) for variant in VARIANTS}
    times: dict[str, list[float]] = {variant: [] for variant in VARIANTS}
    for _ in range(repeats):
        for variant in VARIANTS:
            times[variant].append(seconds(lambda variant=variant: one_pass(variant, given)))
    reference, median = results[REFERENCE], {variant: statistics.median(times[variant]) for variant in VARIANTS}
    return [
        Row(
            variant,
            1e3 * median[variant],
            median[REFERENCE] / median[variant],
            peaks[variant],
            relative(results[variant].loss, reference.loss),
            max(map(relative, results[variant].gradients, reference.gradients)),
        )
        for variant in VARIANTS
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--threads", type=int, default=torch.get_num_threads(), help="of PyTorch")
    parser.add_argument("--repeats", type=int, default=15, help="passes per variant")
    parser.add_argument("--out", type=Path, default=Path("results/benchmark_loss.json"))
    parser.add_argument("--peak-of", choices=VARIANTS, help=argparse.SUPPRESS)
    options = parser.parse_args()
    torch.set_num_threads(options.threads)
    if options.peak_of:
        print(growth_megabytes(options.peak_of))
        return
    rows = measure(options.repeats, options.threads)
    print(f"{N} rows, {N} classes, {D} channels, {options.threads} threads, median of {options.repeats}\n")
    print(f"{'':<28}{'ms':>8}{'speed-up':>10}{'MB':>8}{'loss':>10}{'gradient':>10}")
    for row in rows:
        print(f"{row.variant:<28}{row.milliseconds:>8.0f}{row.speedup:>10.2f}{row.megabytes:>8.0f}", end="")
        print(f"{row.loss_error:>10.1e}{row.gradient_error:>10.1e}")
    made = replace(
        provenance(), command=f"python benchmarks/loss.py --threads {options.threads} --repeats {options.repeats}"
    )
    content = {"n": N, "d": D, "threads": options.threads, "repeats": options.repeats, **asdict(made)}
    with atomic_path(options.out) as temporary:
        temporary.write_text(json.dumps(content | {"rows": [asdict(row) for row in rows]}, indent=1) + "\n")


if __name__ == "__main__":
    main()
