"""Callbacks: validation errors while a network learns, and lines instead of a progress bar."""

from __future__ import annotations

import math
import sys
import time
from collections import deque
from collections.abc import Iterable, Mapping
from typing import Any

import lightning as L
import torch
from torch import Tensor

from csm.data.base import DataModule
from csm.data.shapes import InMemory
from csm.errors import ConfigError, NumericalError
from csm.evaluation.engine import evaluate
from csm.evaluation.metrics import far_rate
from csm.evaluation.protocol import EvaluationProtocol
from csm.evaluation.results import Evaluation
from csm.experiments.ranks import gathered
from csm.learning.loading import FITTED, UNSEEN, LightningData, metric_group
from csm.matching.methods import PrecomputedMethod


class ValidationErrors(L.Callback):
    """Log how well validation shapes are matched to each other, at sampled template points.

    These are `val/age`, the mean error; `val/exact`, the fraction of points matched exactly; `val/far`, that of far
    misses (`csm.evaluation.metrics.far_rate`); and, where the set knows the mirrored template, `val/flip`, that of
    left-right flips.  They are called `fit/age` and so on where the validation shapes are also fitted.

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
        mine, self._descriptors = self._descriptors, {}
        parts = gathered(trainer, mine)
        if parts is not None:
            self.latest = self._measured(loaded, {name: x for each in parts for name, x in each.items()})
        found = trainer.strategy.broadcast(None if self.latest is None else _shown(self.latest))
        for name, value in (found or {}).items():
            pl_module.log(f"{metric_group(trainer)}/{name}", value, prog_bar=True, sync_dist=True)

    def _measured(self, loaded: LightningData, found: dict[str, Tensor]) -> Evaluation | None:
        if len(found) < 2:
            return None
        shapes = InMemory([shape for shape in loaded.data.validation_shapes() if shape.name in found], "validation")
        method = PrecomputedMethod(found, "validation")
        return evaluate(method, shapes, self.protocol, store=loaded.data.store, workers=1, progress=False)[0]


def _shown(measured: Evaluation) -> dict[str, float]:
    """Return the numbers that are logged of a validation, without those that are not known."""
    summary = measured.summary
    found = {"age": summary["age"], "exact": summary["exact"], "far": far_rate(measured.errors)}
    return found if math.isnan(summary["flip_rate"]) else found | {"flip": summary["flip_rate"]}


def require_monitored(callbacks: Iterable[L.Callback], data: DataModule) -> None:
    """Raise a ConfigError if a callback, such as one that stops early, waits for errors that are not measured."""
    for name in (str(getattr(callback, "monitor", None)) for callback in callbacks):
        if name.startswith(f"{UNSEEN}/") and not data.validates_unseen:
            raise ConfigError(
                f"callbacks: one of them has monitor={name}, which is of shapes that are not fitted, but this training "
                f"is validated on {data.watched}; hold some out (data.holdout=10), or monitor {FITTED}{name[3:]}"
            )


class FiniteLoss(L.Callback):
    """End the training when the loss is no number any more, with the step where that began.

    No step waits for it: on a graphics card, which computes while the next steps are being put in its queue, a loss is
    looked at once it has been computed, a few steps later; at the end of an epoch all are.
    """

    def __init__(self) -> None:
        self.pending: deque[_Step] = deque()

    def on_train_batch_end(
        self, trainer: L.Trainer, pl_module: L.LightningModule, outputs: Any, batch: Any, batch_idx: int
    ) -> None:
        """Look at the losses that are there; NumericalError with epoch and shape if one is not finite."""
        loss = outputs["loss"] if isinstance(outputs, Mapping) else outputs
        if loss is None:
            return
        rate = trainer.optimizers[0].param_groups[0]["lr"]
        where = f"in epoch {trainer.current_epoch + 1}, step {batch_idx + 1} (shape {batch.name})"
        self.pending.append(_Step(loss.detach(), f"{where}, at a learning rate of {rate:.3g}"))
        while self.pending and self.pending[0].is_there():
            self._look(self.pending.popleft())

    def on_train_epoch_end(self, trainer: L.Trainer, pl_module: L.LightningModule) -> None:
        """Look at the losses that are left."""
        while self.pending:
            self._look(self.pending.popleft())

    def _look(self, step: _Step) -> None:
        value = step.value()
        if not math.isfinite(value):
            raise NumericalError(
                f"the training has diverged: the loss is {value:g} {step.where}; take a smaller optimizer.lr, or "
                "trainer.gradient_clip_val=1"
            )


class _Step:
    """The loss of a step, on its way to the host."""

    def __init__(self, loss: Tensor, where: str) -> None:
        self.where = where
        self._copied: torch.cuda.Event | None = None
        self._loss = loss
        if loss.is_cuda:
            self._loss = torch.empty((), dtype=loss.dtype, pin_memory=True).copy_(loss, non_blocking=True)
            self._copied = torch.cuda.current_stream(loss.device).record_event()

    def is_there(self) -> bool:
        """Tell whether the loss can be read without waiting."""
        if self._copied is not None:
            return bool(self._copied.query())  # type: ignore[no-untyped-call]
        return self._loss.device.type == "cpu"

    def value(self) -> float:
        """Return the loss, waiting for it if need be."""
        if self._copied is not None:
            self._copied.synchronize()
        return float(self._loss)


class EpochLines(L.Callback):
    """Print one line per epoch into logs: what a progress bar would show, and the time the epoch took.

    Where the output is a terminal, Lightning's own bar is there instead and nothing is printed.  A validation's numbers
    are in the line of its epoch only, and the line says if they are of shapes that are also fitted.
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
        if sys.stdout.isatty() or not trainer.is_global_zero:
            return
        group = f"{metric_group(trainer)}/"
        shown = {
            name: float(value)
            for name, value in trainer.progress_bar_metrics.items()
            if self._validated or not name.startswith(group)
        }
        numbers = "".join(f", {name} {value:.4g}" for name, value in shown.items())
        if group == f"{FITTED}/" and any(name.startswith(group) for name in shown):
            numbers += f" ({group} is of shapes that are also fitted)"
        seconds = time.perf_counter() - self._begun
        print(f"epoch {trainer.current_epoch + 1} of {trainer.max_epochs}: {seconds:.1f} s{numbers}", flush=True)
