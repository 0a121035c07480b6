"""What TensorBoard shows beside the scalars: the protocol, hyper-parameters, curves, learned filters, a map."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import lightning as L
import torch
from lightning.pytorch.loggers import TensorBoardLogger

from csm.data.datamodule import CorrespondenceDataModule
from csm.evaluation.matching import nearest
from csm.learning.callbacks import ValidationErrors
from csm.learning.module import CSMModule
from csm.viewer.figures import correspondence_figure, cqc_figure, filters_figure

_METRICS = ("val/age", "val/exact", "val/loss", "train/loss")


class TensorBoardPanels(L.Callback):
    """Fill TensorBoard's TEXT, IMAGES and HPARAMS tabs; without a TensorBoard logger it does nothing.

    Parameters
    ----------
    errors
        The callback that measures the validation errors; its curve is drawn.
    hparams
        What the HPARAMS tab compares runs by; nested mappings are flattened with dots.
    """

    def __init__(self, errors: ValidationErrors, hparams: Mapping[str, Any]) -> None:
        self.errors = errors
        self.hparams = flatten(hparams)

    def on_fit_start(self, trainer: L.Trainer, pl_module: L.LightningModule) -> None:
        """Write the protocol, and the hyper-parameters with results that are not known yet."""
        logger, data = _logger(trainer), _data(trainer)
        if logger is None:
            return
        logger.log_hyperparams(self.hparams, {f"hp/{name}": math.nan for name in _METRICS})
        if data is not None:
            validation = self.errors.protocol.describe()
            logger.experiment.add_text("protocol", f"{data.protocol}.\n\nMonitor during training: {validation}")

    def on_validation_end(self, trainer: L.Trainer, pl_module: L.LightningModule) -> None:
        """Draw the curve of the validation errors."""
        logger, latest = _logger(trainer), self.errors.latest
        if logger is not None and latest is not None:
            figure = cqc_figure({f"epoch {trainer.current_epoch}": latest})
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

    def _draw(self, logger: TensorBoardLogger, data: CorrespondenceDataModule, module: CSMModule) -> None:
        source, target = (data.load(data.train_set, data.validation_names[i]) for i in (0, -1))
        indices = nearest(module.describe(source.sample), module.describe(target.sample))
        figure = correspondence_figure(source.shape.mesh, target.shape.mesh, indices)
        logger.experiment.add_figure("maps/validation", figure)
        filters = getattr(module.network, "filters", None)
        if filters is None:
            return
        evals = source.sample.surface.basis.evals.to(module.device)
        with torch.no_grad():
            responses = {name: response.cpu().numpy() for name, response in filters(evals).items()}
        k = len(next(iter(responses.values())))
        logger.experiment.add_figure("filters", filters_figure(evals[:k].cpu().numpy(), responses))


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
    return next((logger for logger in trainer.loggers if isinstance(logger, TensorBoardLogger)), None)


def _data(trainer: L.Trainer) -> CorrespondenceDataModule | None:
    data = trainer.datamodule  # type: ignore[attr-defined]
    return data if isinstance(data, CorrespondenceDataModule) else None
