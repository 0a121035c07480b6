"""What TensorBoard shows beside the scalars: the protocol, hyper-parameters, curves, learned filters, a map."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import lightning as L
import torch
from lightning.pytorch.loggers import TensorBoardLogger

from csm.experiments.callbacks import ValidationErrors
from csm.learning.loading import LightningData
from csm.learning.module import CSMModule
from csm.learning.samples import NetworkInput
from csm.matching.nearest import nearest
from csm.viewer.figures import correspondence_figure, cqc_figure, filters_figure

_METRICS = ("val/age", "val/exact", "val/loss", "train/loss")


class TensorBoardPanels(L.Callback):
    """Fill TensorBoard's TEXT, IMAGES and HPARAMS tabs; without a TensorBoard logger it does nothing.

    Parameters
    ----------
    hparams
        What the HPARAMS tab compares runs by; nested mappings are flattened with dots.  `csm.experiments.training.fit`
        fills in the settings of the training if there are none.

    Notes
    -----
    The curve of the validation errors is drawn if the trainer has a `ValidationErrors` callback.
    """

    def __init__(self, hparams: Mapping[str, Any] | None = None) -> None:
        self.hparams = hparams or {}

    def on_fit_start(self, trainer: L.Trainer, pl_module: L.LightningModule) -> None:
        """Write the protocol, and the hyper-parameters with results that are not known yet."""
        logger, data = _logger(trainer), _data(trainer)
        if logger is None:
            return
        logger.log_hyperparams(flatten(self.hparams), {f"hp/{name}": math.nan for name in _METRICS})
        if data is not None:
            errors = _errors(trainer)
            monitor = "" if errors is None else f"\n\nMonitor during training: {errors.protocol.describe()}"
            logger.experiment.add_text("protocol", f"{data.data.protocol}.{monitor}")

    def on_validation_end(self, trainer: L.Trainer, pl_module: L.LightningModule) -> None:
        """Draw the curve of the validation errors."""
        logger, errors = _logger(trainer), _errors(trainer)
        if logger is not None and errors is not None and errors.latest is not None:
            figure = cqc_figure({f"epoch {trainer.current_epoch}": errors.latest})
            logger.experiment.add_figure("val/cqc", figure, trainer.global_step)

    def on_fit_end(self, trainer: L.Trainer, pl_module: L.LightningModule) -> None:
        """Fill in the results; draw the learned filters and one map between validation shapes."""
        logger, data = _logger(trainer), _data(trainer)
        if logger is None:
            return
        known = {name: float(v) for name, v in trainer.callback_metrics.items() if name in _METRICS}
        logger.log_metrics({f"hp/{name}": value for name, value in known.items()}, trainer.global_step)
        if data is not None and isinstance(pl_module, CSMModule):
            self._draw(logger, data, pl_module)
        logger.experiment.flush()

    def _draw(self, logger: TensorBoardLogger, loaded: LightningData, module: CSMModule) -> None:
        names = [loaded.data.validation_names[i] for i in (0, -1)]
        samples = [loaded.sample(name) for name in names]
        here, there = (module.describe(NetworkInput(sample.features, sample.surface)) for sample in samples)
        meshes = [loaded.data.shape(name).mesh for name in names]
        figure = correspondence_figure(meshes[0], meshes[1], nearest(here, there))
        logger.experiment.add_figure("maps/validation", figure)
        evals = samples[0].surface.basis.evals.to(module.device)
        with torch.no_grad():
            filters = {name: response.cpu().numpy() for name, response in module.network.filters(evals).items()}
        if filters:
            k = len(next(iter(filters.values())))
            logger.experiment.add_figure("filters", filters_figure(evals[:k].cpu().numpy(), filters))


def flatten(tree: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Flatten nested mappings into one with dotted keys; lists become text, as TensorBoard compares scalars only.

    Examples
    --------
    >>> flatten({"model": {"ks": 64, "channels": [64, 128]}, "seed": 0})
    {'model.ks': 64, 'model.channels': '[64, 128]', 'seed': 0}
    """
    flat: dict[str, Any] = {}
    for key, value in tree.items():
        name = f"{prefix}{key}"
        if isinstance(value, Mapping):
            flat |= flatten(value, f"{name}.")
        else:
            flat[name] = value if isinstance(value, int | float | str | bool) else str(value)
    return flat


def _logger(trainer: L.Trainer) -> TensorBoardLogger | None:
    if not trainer.is_global_zero:
        return None
    return next((logger for logger in trainer.loggers if isinstance(logger, TensorBoardLogger)), None)


def _data(trainer: L.Trainer) -> LightningData | None:
    data = trainer.datamodule  # type: ignore[attr-defined]
    return data if isinstance(data, LightningData) else None


def _errors(trainer: L.Trainer) -> ValidationErrors | None:
    return next((c for c in trainer.callbacks if isinstance(c, ValidationErrors)), None)  # type: ignore[attr-defined]
