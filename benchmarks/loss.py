"""Time and memory of the chunked classifier loss against PyTorch's own, both measured in this run.

    python benchmarks/loss.py --threads 2

One pass is loss and gradients of ``linear_cross_entropy`` or of ``F.linear`` with ``F.cross_entropy`` at the size of a
FAUST shape.  "products alone" are the three products of matrices that no such loss can do without, of the scores and of
both gradients, and of no use by themselves: what is left of the machine's speed.  The variants take turns, so that a
busy machine slows all of them; the time is the median, the ratio the reference's time over the variant's.  Peak memory
is what a fresh process needs beyond its inputs.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import torch
from measuring import growth_megabytes, median_milliseconds, options, peak_megabytes, write
from torch import Tensor
from torch.nn import functional as F

from csm.learning.loss import linear_cross_entropy

N, D = 6890, 256
REFERENCE = "F.linear + F.cross_entropy"
CHUNKED = {f"{products}, chunk {c}": (products, c) for products in ("float32", "bfloat16") for c in (128, 512, 2048)}
PRODUCTS = {
    f"products alone, {name}": kind for name, kind in (("float32", torch.float32), ("bfloat16", torch.bfloat16))
}
VARIANTS = [REFERENCE, *CHUNKED, *PRODUCTS]
_PART = 512  # rows at a time

Problem = tuple[Tensor, Tensor, Tensor, Tensor]


@dataclass(frozen=True)
class Row:
    """What was measured of one variant."""

    variant: str
    milliseconds: float
    speedup: float
    megabytes: float
    loss_error: float | None
    gradient_error: float | None


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


def products_alone(kind: torch.dtype, given: Problem) -> None:
    """Compute the products of the scores, of the gradient of x and of that of the weight, part by part."""
    x, weight = (each.detach().to(kind) for each in given[:2])
    scores, found, whole = (
        torch.empty(_PART, len(weight), dtype=kind),
        torch.empty(_PART, D, dtype=kind),
        torch.zeros_like(weight),
    )
    for part in x.split(_PART):
        rows = len(part)
        torch.mm(part, weight.T, out=scores[:rows])
        torch.mm(scores[:rows], weight, out=found[:rows])
        torch.addmm(whole, scores[:rows].T, part, out=whole)


def run(variant: str, given: Problem) -> None:
    """Do what is timed of a variant."""
    if variant in PRODUCTS:
        products_alone(PRODUCTS[variant], given)
    else:
        one_pass(variant, given)


def relative(found: Tensor, wanted: Tensor) -> float:
    return float((found - wanted).norm() / wanted.norm())


def own_peak(variant: str) -> float:
    """Return what one pass needs; a tiny pass first loads the libraries."""
    given = problem()
    run(variant, (given[0][:8], given[1][:8], given[2][:8], torch.arange(8)))
    return growth_megabytes(lambda: run(variant, given))


def measure(repeats: int, threads: int) -> list[Row]:
    # First, while this process is small: on Linux a child starts with its parent's peak.
    peaks = {variant: peak_megabytes(variant, threads) for variant in VARIANTS}
    given = problem()
    results = {variant: one_pass(variant, given) for variant in (REFERENCE, *CHUNKED)}
    median = median_milliseconds({variant: partial(run, variant, given) for variant in VARIANTS}, repeats)
    return [
        Row(
            variant,
            median[variant],
            median[REFERENCE] / median[variant],
            peaks[variant],
            *(errors(results[variant], results[REFERENCE]) if variant in results else (None, None)),
        )
        for variant in VARIANTS
    ]


def errors(found: Pass, wanted: Pass) -> tuple[float, float]:
    """Return the relative errors of the loss and of the worst gradient."""
    return relative(found.loss, wanted.loss), max(map(relative, found.gradients, wanted.gradients))


def main() -> None:
    chosen = options("loss", __doc__, VARIANTS, repeats=15)
    if chosen.peak_of:
        print(own_peak(chosen.peak_of))
        return
    rows = measure(chosen.repeats, chosen.threads)
    print(f"{N} rows, {N} classes, {D} channels, {chosen.threads} threads, median of {chosen.repeats}\n")
    print(f"{'':<28}{'ms':>8}{'speed-up':>10}{'MB':>8}{'loss':>10}{'gradient':>10}")
    for row in rows:
        print(f"{row.variant:<28}{row.milliseconds:>8.0f}{row.speedup:>10.2f}{row.megabytes:>8.0f}", end="")
        print("" if row.loss_error is None else f"{row.loss_error:>10.1e}{row.gradient_error:>10.1e}")
    write("loss", chosen, {"n": N, "d": D}, rows)


if __name__ == "__main__":
    main()
