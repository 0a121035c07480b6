"""How the losses and errors of a training went, epoch by epoch, for its report."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from typing import Any, TypeAlias

import lightning as L

from csm.learning.loading import metric_group

Curves: TypeAlias = Mapping[str, list[tuple[int, float]]]
"""Name of a metric -> epochs, counted from 1, and its values after them."""

_TRAINED = "train/loss"


class History(L.Callback):
    """Keep the training loss of every epoch and the numbers of every validation, also when a training goes on later.

    Attributes
    ----------
    curves
        Name of a metric -> epochs, counted from 1, and its values.
    seconds
        How long the epochs took, those before an interruption included.
    """

    def __init__(self) -> None:
        self.curves: dict[str, list[tuple[int, float]]] = {}
        self.seconds = 0.0
        self._validated = False
        self._since = time.perf_counter()

    def on_fit_start(self, trainer: L.Trainer, pl_module: L.LightningModule) -> None:
        """Begin to count the seconds of this part of the training."""
        self._since = time.perf_counter()

    def on_validation_epoch_end(self, trainer: L.Trainer, pl_module: L.LightningModule) -> None:
        """Note that this epoch has numbers of a validation."""
        self._validated = not trainer.sanity_checking

    def on_train_epoch_end(self, trainer: L.Trainer, pl_module: L.LightningModule) -> None:
        """Keep the numbers of the epoch."""
        group = f"{metric_group(trainer)}/"
        for name, value in trainer.callback_metrics.items():
            new = name == _TRAINED or (self._validated and name.startswith(group))
            if new and math.isfinite(float(value)):
                self.curves.setdefault(name, []).append((trainer.current_epoch + 1, float(value)))
        self._validated = False
        now = time.perf_counter()
        self.seconds, self._since = self.seconds + now - self._since, now

    def state_dict(self) -> dict[str, Any]:
        """Return the curves as plain data, for checkpoints."""
        curves = {name: [list(point) for point in curve] for name, curve in self.curves.items()}
        return {"curves": curves, "seconds": self.seconds}

    def load_state_dict(self, state_dict: dict[str, Any]) -> None:
        """Go on with the curves of a checkpoint."""
        kept = state_dict["curves"]
        self.curves = {name: [(int(epoch), float(v)) for epoch, v in curve] for name, curve in kept.items()}
        self.seconds = float(state_dict.get("seconds", 0.0))

    @property
    def last(self) -> dict[str, float]:
        """The last value of every curve."""
        return {name: curve[-1][1] for name, curve in self.curves.items()}


def history_of(trainer: L.Trainer) -> History:
    """Return the `History` of a trainer, an empty one if it has none."""
    return next((c for c in trainer.callbacks if isinstance(c, History)), History())  # type: ignore[attr-defined]
