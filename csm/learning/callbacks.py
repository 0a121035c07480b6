"""Callbacks: validation errors while a network learns."""

from __future__ import annotations

from typing import Any

import lightning as L
import numpy as np
import torch
from torch import Tensor

from csm.data.datamodule import CorrespondenceDataModule
from csm.data.shapeset import Shape
from csm.evaluation.matching import nearest
from csm.evaluation.protocol import EvalShape, Evaluation, Protocol, evaluate_matches


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
        self.protocol = Protocol(sample=pairs, seed=seed, distance="heat")
        self.points = points
        self.seed = seed
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
        shapes = [self._thinned(shape) for shape in datamodule.validation_shapes()]
        found, self._descriptors = self._descriptors, {}

        def match(source: EvalShape, target: EvalShape) -> np.ndarray:
            chosen = source.truth.indices[source.truth.indices >= 0]
            indices = np.full(source.mesh.n_vertices, -1)
            indices[chosen] = nearest(found[source.name][torch.as_tensor(chosen)], found[target.name])
            return indices

        self.latest = evaluate_matches(shapes, match, self.protocol, progress=False)
        pl_module.log("val/age", self.latest.summary["age"], prog_bar=True)
        pl_module.log("val/exact", self.latest.summary["exact"], prog_bar=True)

    def _thinned(self, shape: Shape) -> EvalShape:
        """Return the shape with only the sampled template points known."""
        indices = shape.truth.indices
        keep = np.random.default_rng(self.seed).permutation(len(indices))[: self.points]
        thin = np.full_like(indices, -1)
        thin[keep] = indices[keep]
        truth = type(shape.truth)(thin, shape.truth.direction, shape.truth.n_to, shape.truth.name)
        return EvalShape(shape.name, shape.mesh, truth)
