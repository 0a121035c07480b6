"""Callbacks: validation errors while a network learns, and lines instead of a progress bar."""

from __future__ import annotations

import time
from typing import Any

import lightning as L
from torch import Tensor

from csm._types import IntArray
from csm.data.datamodule import CorrespondenceDataModule
from csm.data.shapeset import Shape
from csm.evaluation.matching import nearest
from csm.evaluation.protocol import Protocol, evaluate_matches
from csm.evaluation.results import Evaluation


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
    that is reported at the end.
    """

    def __init__(self, pairs: int = 6, points: int = 500, seed: int = 0) -> None:
        self.protocol = Protocol(sample=pairs, points=points, seed=seed, distance="heat")
        self.latest: Evaluation | None = None
        self._descriptors: dict[str, Tensor] = {}

    def on_validation_batch_end(
        self, trainer: L.Trainer, pl_module: L.LightningModule, outputs: Any, batch: Any, *args: Any, **kwargs: Any
    ) -> None:
        """Keep the descriptor of the shape."""
        self._descriptors[batch.name] = outputs.detach().float().cpu()

    def on_validation_epoch_end(self, trainer: L.Trainer, pl_module: L.LightningModule) -> None:
        """Match the sampled pairs and log the errors."""
        datamodule = trainer.datamodule  # type: ignore[attr-defined]
        if trainer.sanity_checking or not isinstance(datamodule, CorrespondenceDataModule):
            return
        found, self._descriptors = self._descriptors, {}
        shapes = [shape for shape in datamodule.validation_shapes() if shape.name in found]

        def match(source: Shape, target: Shape) -> IntArray:
            return nearest(found[source.name], found[target.name], at=source.truth.known)

        self.latest = evaluate_matches(shapes, match, self.protocol, progress=False)
        pl_module.log("val/age", self.latest.summary["age"], prog_bar=True)
        pl_module.log("val/exact", self.latest.summary["exact"], prog_bar=True)


class EpochLines(L.Callback):
    """Print one line per epoch, for logs: what a progress bar would show, and the time the epoch took.

    A validation's numbers are in the line of its epoch only.
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
        shown = {
            name: float(value)
            for name, value in trainer.progress_bar_metrics.items()
            if self._validated or not name.startswith("val/")
        }
        numbers = "".join(f", {name} {value:.4g}" for name, value in shown.items())
        seconds = time.perf_counter() - self._begun
        print(f"epoch {trainer.current_epoch + 1} of {trainer.max_epochs}: {seconds:.1f} s{numbers}", flush=True)
