"""Trainings in two processes, started by PyTorch's launcher: ``torchrun -m tests.experiments.two_ranks FOLDER``."""

from __future__ import annotations

import json
import subprocess
import sys
from functools import partial
from pathlib import Path
from typing import Any

import lightning as L

from csm.data.additional import Additional
from csm.data.shapes import InMemory
from csm.experiments.callbacks import EpochLines, ValidationErrors
from csm.experiments.training import Trained, Training, fit
from tests.experiments.toys import a_training
from tests.learning.toys import NETWORK, QUICK
from tests.toyset import toy_datamodule

RANDOM = {"network": NETWORK | {"dropout": 0.3}, "options": {"lr": 1e-2, "loss_rows": 40}}


class Losses(L.Callback):
    """Keep the numbers of every epoch, the rate of every step, and which shapes this process saw."""

    def __init__(self) -> None:
        self.epochs: list[dict[str, float]] = []
        self.rates: list[float] = []
        self.shapes: list[str] = []

    def on_train_batch_start(self, trainer, pl_module, batch, batch_idx):
        self.shapes.append(batch.name)

    def on_before_zero_grad(self, trainer, pl_module, optimizer):
        self.rates.append(optimizer.param_groups[0]["lr"])

    def on_train_epoch_end(self, trainer, pl_module):
        self.epochs.append({name: float(value) for name, value in trainer.callback_metrics.items()})


def training(folder: Path, epochs: int, ranks: int, *callbacks: L.Callback, **changes: Any) -> Training:
    """Return a training over four shapes in two processes, or in one that takes two shapes per step."""
    how = {"strategy": "ranks", "devices": 2} if ranks == 2 else {"accumulate_grad_batches": 2}
    trainer = partial(L.Trainer, **(QUICK | how | {"max_epochs": epochs, "check_val_every_n_epoch": 2}))
    return a_training(folder, trainer=trainer, callbacks=callbacks, **changes)


def curve(folder: Path, name: str, ranks: int, epochs: int = 4, **changes: Any) -> tuple[Trained, Losses]:
    """Train with a one-cycle rate, and return what came of it."""
    losses = Losses()
    settings: dict[str, Any] = {"options": {"lr": 1e-2, "schedule": "one_cycle"}} | changes
    callbacks = (ValidationErrors(pairs=4, points=50), losses, EpochLines())
    return fit(training(folder, epochs, ranks, *callbacks, **settings), folder / name), losses


def unmoved(folder: Path, ranks: int) -> dict[str, float]:
    """Return the numbers of a network that is not changed, for three validation shapes in two shares."""
    data = toy_datamodule(folder, holdout=3, n_test=1)
    return dict(curve(folder, f"unmoved{ranks}", ranks, 2, data=data, options={"lr": 0.0})[0].measured)


def others(folder: Path, ranks: int) -> tuple[Trained, Losses]:
    """Train with one shape over a template of its own, which has a classifier of its own."""
    data = toy_datamodule(folder)
    data.also = (Additional(InMemory([data.test_sets["toys"].load("toy5")], "more"), ("toy5",) * 2, "other"),)
    return curve(folder, f"others{ranks}", ranks, 2, data=data)


def main(folder: Path) -> None:
    """Do all trainings of the tests, and keep what they gave per rank."""
    trained, losses = curve(folder, "two", 2)
    found: dict[str, Any] = {"epochs": losses.epochs, "rates": losses.rates, "shapes": losses.shapes}
    found["others"] = others(folder, 2)[1].epochs
    found["unmoved"] = unmoved(folder, 2)
    fit(training(folder, 4, 2, **RANDOM), folder / "whole")
    fit(training(folder, 2, 2, **RANDOM), folder / "cut")
    fit(training(folder, 4, 2, **RANDOM), folder / "cut")
    (folder / f"rank{trained.rank}.json").write_text(json.dumps(found))


def run(folder: Path) -> subprocess.CompletedProcess[str]:
    """Run `main` in two processes."""
    how = ["-m", "torch.distributed.run", "--standalone", "--nproc-per-node=2", "-m", "tests.experiments.two_ranks"]
    return subprocess.run([sys.executable, *how, str(folder)], text=True, capture_output=True, timeout=900)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
