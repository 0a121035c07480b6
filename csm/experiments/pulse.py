"""How a training is doing beside its losses: learning rate, gradient norm, seconds per step and memory."""

from __future__ import annotations

import time
from typing import Any

import lightning as L
import torch
from torch.optim import Optimizer

from csm._peak import peak_megabytes


class Pulse(L.Callback):
    """Log `step/learning_rate`, `step/gradient_norm`, `step/seconds` and `step/memory_mb`.

    They are written as often as the trainer logs (`trainer.log_every_n_steps`), and nothing waits for the device.
    Seconds are those from the end of a step to the end of the next within an epoch; memory is the largest that the
    process, or the graphics card, has had so far.
    """

    def __init__(self) -> None:
        self._begun = time.perf_counter()

    def on_train_epoch_start(self, trainer: L.Trainer, pl_module: L.LightningModule) -> None:
        """Start the clock: what happens between epochs is no step."""
        self._begun = time.perf_counter()

    def on_before_optimizer_step(self, trainer: L.Trainer, pl_module: L.LightningModule, optimizer: Optimizer) -> None:
        """Log the gradient norm and the learning rate of the step that is made now."""
        norms = [p.grad.detach().norm() for p in pl_module.parameters() if p.grad is not None]
        if trainer.loggers and norms:
            pl_module.log("step/gradient_norm", torch.stack(norms).norm())
            pl_module.log("step/learning_rate", float(optimizer.param_groups[0]["lr"]))

    def on_train_batch_end(
        self, trainer: L.Trainer, pl_module: L.LightningModule, outputs: Any, batch: Any, batch_idx: int
    ) -> None:
        """Log the time and the memory."""
        begun, self._begun = self._begun, time.perf_counter()
        if trainer.loggers:
            pl_module.log("step/seconds", self._begun - begun)
            pl_module.log("step/memory_mb", peak_memory(pl_module.device))


def peak_memory(device: torch.device) -> float:
    """Return the largest memory so far in MB, of the graphics card if there is one, else of the process."""
    return torch.cuda.max_memory_allocated(device) / 2**20 if device.type == "cuda" else peak_megabytes()
