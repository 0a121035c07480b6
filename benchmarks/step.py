"""Time of a whole step of training against the obvious one, and how much of it is not the loss.

    python benchmarks/step.py --threads 2

One step is that of csm's own network on a shape of 6,899 vertices, all of them classes: forward, loss, backward, Adam.
The reference takes the loss as ``F.cross_entropy(F.linear(...))`` over all vertices in float32.  The variants take
turns; the time is the median, the ratio the reference's time over the variant's.  "rest" is the share of the step that
is left where the loss costs nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from tempfile import TemporaryDirectory

import torch
from measuring import median_milliseconds, options, write
from torch.nn import functional as F

from csm import load_humans
from csm.data.prepare import Recipe, prepare_mesh
from csm.data.store import Store
from csm.descriptors import HKS
from csm.descriptors.base import record
from csm.learning.module import CSMModule
from csm.learning.samples import ShapeSample, network_input
from csm.networks import Surface, settings

COLUMNS, BASIS = 688, 256
REFERENCE, REST = "F.linear + F.cross_entropy, all rows", "without the loss"
OURS = {
    "float32, all rows": ("float32", None),
    "bfloat16, all rows": ("bfloat16", None),
    "float32, 1024 rows": ("float32", 1024),
    "bfloat16, 1024 rows": ("bfloat16", 1024),
}
GOALS = {"float32, all rows": 1.6, "bfloat16, all rows": 4.0}


@dataclass(frozen=True)
class Row:
    """What was measured of one variant; `rest` is in percent."""

    variant: str
    milliseconds: float
    ratio: float
    goal: float | None
    rest: float


@dataclass(frozen=True, eq=False)
class Step:
    """A network, its optimiser, and a shape."""

    module: CSMModule
    optimiser: torch.optim.Optimizer
    sample: ShapeSample

    def take(self, variant: str) -> None:
        """Make one step."""
        self.optimiser.zero_grad()
        last = self.module(self.sample.features, self.sample.surface)
        if variant == REST:
            loss = last.square().mean()
        elif variant == REFERENCE:
            classifier = self.module.network.classifier
            loss = F.cross_entropy(F.linear(last, classifier.weight, classifier.bias), self.sample.classes)
        else:
            self.module.loss_products, self.module.loss_rows = OURS[variant]  # type: ignore[assignment]
            loss = self.module.loss(last, self.sample)
        loss.backward()  # type: ignore[no-untyped-call]
        self.optimiser.step()


def made(surface: Surface, n: int) -> Step:
    """Return the step of an untrained network on a surface of `n` vertices, with random numbers for its input."""
    torch.manual_seed(0)
    network = dict(settings("csmcnn_own"))
    module = CSMModule(network, COLUMNS, n, record(HKS()), basis_k=BASIS, standardise=True)
    module.train()
    every = torch.arange(n)
    sample = ShapeSample("human", torch.randn(n, COLUMNS), surface, every, every, "", 1)
    return Step(module, torch.optim.Adam(module.parameters()), sample)


def main() -> None:
    chosen = options("step", __doc__, [REFERENCE, *OURS], repeats=9)
    mesh = load_humans()[0]
    with TemporaryDirectory() as folder:
        surface = network_input(prepare_mesh(mesh, Recipe(HKS(), BASIS), Store(folder))).surface
    variants = [REFERENCE, *OURS, REST]
    runs = {variant: partial(made(surface, mesh.n_vertices).take, variant) for variant in variants}
    for run in runs.values():
        run()
    median = median_milliseconds(runs, chosen.repeats)
    rows = [
        Row(v, median[v], median[REFERENCE] / median[v], GOALS.get(v), 100 * median[REST] / median[v])
        for v in (REFERENCE, *OURS)
    ]
    for row in rows:
        print(f"{row.variant:<40}{row.milliseconds:>8.0f} ms{row.ratio:>7.2f}  rest {row.rest:.0f} %")
    write("step", chosen, {"n": mesh.n_vertices, "columns": COLUMNS}, rows)


if __name__ == "__main__":
    main()
