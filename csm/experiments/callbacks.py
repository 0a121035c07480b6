"""Callbacks: validation errors while a network learns, and lines instead of a progress bar."""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping
from typing import Any

import lightning as L
import torch
from torch import Tensor

from csm.data.shapes import InMemory
from csm.errors import NumericalError
from csm.evaluation.engine import evaluate
from csm.evaluation.protocol import EvaluationProtocol
from csm.evaluation.results import Evaluation
from csm.learning.loading import LightningData
from csm.matching.methods import PrecomputedMethod


class ValidationErrors(L.Callback):
    """Log `val/age` and `val/exact`: matching errors between validation shapes, at sampled template points.

    Parameters
    ----------
    pairs
        How many ordered pairs of validation shapes, drawn once.
    points
        How many template points per pair, drawn once.
    seed
        Of both draws.

    Notes
    -----
    Distances are heat-method distances over the diameter: a monitor, cheap enough for every epoch, and not the number
    that is reported at the end.  Nothing is logged where fewer than two shapes are validated.
    """

    def __init__(self, pairs: int = 6, points: int = 500, seed: int = 0) -> None:
        self.protocol = EvaluationProtocol(sample=pairs, points=points, seed=seed, distance="heat")
        self.latest: Evaluation | None = None
        self._descriptors: dict[str, Tensor] = {}

    def on_validation_batch_end(
        self, trainer: L.Trainer, pl_module: L.LightningModule, outputs: Any, batch: Any, *args: Any, **kwargs: Any
    ) -> None:
        """Keep the descriptor of the shape."""
        self._descriptors[batch.name] = outputs.detach().float().cpu()

    def on_validation_epoch_end(self, trainer: L.Trainer, pl_module: L.LightningModule) -> None:
        """Match the sampled pairs and log the errors."""
        loaded = trainer.datamodule  # type: ignore[attr-defined]
        if trainer.sanity_checking or not isinstance(loaded, LightningData):
            return
        found, self._descriptors = self._descriptors, {}
        if len(found) < 2:
            return
        shapes = InMemory([shape for shape in loaded.data.validation_shapes() if shape.name in found], "validation")
        method = PrecomputedMethod(found, "validation")
        (self.latest,) = evaluate(method, shapes, self.protocol, store=loaded.data.store, workers=1, progress=False)
        pl_module.log("val/age", self.latest.summary["age"], prog_bar=True)
        pl_module.log("val/exact", self.latest.summary["exact"], prog_bar=True)


class FiniteLoss(L.Callback):
    """End the training at the step where the loss is no number any more."""

    def on_train_batch_end(
        self, trainer: L.Trainer, pl_module: L.LightningModule, outputs: Any, batch: Any, batch_idx: int
    ) -> None:
        """Look at the loss; NumericalError with epoch and shape if it is not finite."""
        loss = outputs["loss"] if isinstance(outputs, Mapping) else outputs
        if loss is None or bool(torch.isfinite(loss).all()):
            return
        rate = trainer.optimizers[0].param_groups[0]["lr"]
        raise NumericalError(
            f"the training has diverged: the loss is {float(loss):g} in epoch {trainer.current_epoch + 1}, step "
            f"{batch_idx + 1} (shape {batch.name}), at a learning rate of {rate:.3g}; take a smaller optimizer.lr, or "
            "trainer.gradient_clip_val=1"
        )


class EpochLines(L.Callback):
    """Print one line per epoch into logs: what a progress bar would show, and the time the epoch took.

    Where the output is a terminal, Lightning's own bar is there instead and nothing is printed.  A validation's numbers
    are in the line of its epoch only.
    """

    def __init__(self) -> None:
        self._begun, self._validated = time.perf_counter(), False

    def on_train_epoch_start(self, trainer: L.Trainer, pl_module: L.LightningModule) -> None:
        """Start the clock."""
        self._begun, self._validated = time.perf_counter(), False

    def on_validation_epoch_end(self, trainer: L.Trainer, pl_module: L.LightningModule) -> None:
        """Note that this epoch has numbers of a validation."""
        self._validated = True

    def on_train_epoch_end(self, trainer: L.Trainer, pl_module: L.LightningModule) -> None:
        """Print the line."""
        if sys.stdout.isatty():
            return
        shown = {
            name: float(value)
            for name, value in trainer.progress_bar_metrics.items()
            if self._validated or not name.startswith("val/")
        }
        numbers = "".join(f", {name} {value:.4g}" for name, value in shown.items())
        seconds = time.perf_counter() - self._begun
        print(f"epoch {trainer.current_epoch + 1} of {trainer.max_epochs}: {seconds:.1f} s{numbers}", flush=True)
