"""What TensorBoard shows beside the scalars: the protocol, hyper-parameters, curves, learned filters, a map."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import lightning as L
import torch
from lightning.pytorch.loggers import TensorBoardLogger
from matplotlib.figure import Figure
from torch.utils.tensorboard.summary import hparams

from csm.experiments.callbacks import ValidationErrors
from csm.experiments.pairs import view_of_most
from csm.learning.loading import FITTED, LightningData, metric_group
from csm.learning.module import CSMModule
from csm.learning.samples import NetworkInput
from csm.matching.nearest import nearest
from csm.viewer.figures import correspondence_figure, cqc_figure, filters_figure

_ERRORS = ("age", "exact", "far", "flip", "loss")


class TensorBoardPanels(L.Callback):
    """Fill TensorBoard's TEXT, IMAGES and HPARAMS tabs; without a TensorBoard logger it does nothing.

    Parameters
    ----------
    hparams
        What the HPARAMS tab compares runs by; nested mappings are flattened with dots.  `csm.experiments.training.fit`
        fills in the settings of the training if there are none.
    pictures
        At how many validations, evenly spread, pictures are drawn; there are up to two more, at the first and the last.

    Notes
    -----
    The curve of the validation errors is drawn if the trainer has a `ValidationErrors` callback.
    """

    def __init__(self, hparams: Mapping[str, Any] | None = None, pictures: int = 10) -> None:
        self.hparams, self.pictures = hparams or {}, pictures
        self._drawn: int | None = None

    def on_fit_start(self, trainer: L.Trainer, pl_module: L.LightningModule) -> None:
        """Write the protocol, and the hyper-parameters with the names of the results, which are not known yet."""
        logger, data = _logger(trainer), _data(trainer)
        if logger is None:
            return
        self._drawn, settings = None, flatten(self.hparams)
        logger.log_hyperparams(settings, {})  # with numbers, they would be the first points of its curves
        for summary in hparams(settings, {f"hp/{name}": 0.0 for name in _results(trainer)}):  # type: ignore[no-untyped-call]
            logger.experiment._get_file_writer().add_summary(summary)
        if data is not None:
            errors = _errors(trainer)
            monitor = "" if errors is None else f"\n\nMonitor during training: {errors.protocol.describe()}"
            logger.experiment.add_text("protocol", f"{data.data.protocol}.{monitor}")

    def on_validation_end(self, trainer: L.Trainer, pl_module: L.LightningModule) -> None:
        """Draw the pictures, if it is time."""
        done, every = trainer.current_epoch + 1, trainer.check_val_every_n_epoch or 1
        if not trainer.sanity_checking and is_due(done // every, (trainer.max_epochs or 0) // every, self.pictures):
            self._draw(trainer, pl_module, done)

    def on_fit_end(self, trainer: L.Trainer, pl_module: L.LightningModule) -> None:
        """Fill in the results, and draw the pictures of the last step unless they are there."""
        logger = _logger(trainer)
        if logger is None:
            return
        known = {name: float(v) for name, v in trainer.callback_metrics.items() if name in _results(trainer)}
        logger.log_metrics({f"hp/{name}": value for name, value in known.items()}, trainer.global_step)
        if self._drawn != trainer.global_step:
            self._draw(trainer, pl_module, trainer.current_epoch, validated=False)
        logger.experiment.flush()

    def _draw(self, trainer: L.Trainer, module: L.LightningModule, epoch: int, validated: bool = True) -> None:
        """Draw curve, map and filters after so many epochs; the curve only where the errors have just been measured."""
        logger, loaded, errors = _logger(trainer), _data(trainer), _errors(trainer)
        if logger is None:
            return
        self._drawn, group = trainer.global_step, metric_group(trainer)
        figures = {}
        if validated and errors is not None and errors.latest is not None:
            figures[f"{group}/cqc"] = cqc_figure({f"epoch {epoch}": errors.latest})
        if loaded is not None and isinstance(module, CSMModule):
            figures[f"{group}/map"] = _map(loaded, module)
            figures |= _filters(loaded, module)
        shapes = "shapes that are also fitted" if group == FITTED else "shapes that are not fitted"
        for name, figure in figures.items():
            figure.suptitle(f"epoch {epoch}" if name == "filters" else f"epoch {epoch}, {shapes}", fontsize=9)
            logger.experiment.add_figure(name, figure, trainer.global_step)


def is_due(number: int, total: int, pictures: int) -> bool:
    """Tell whether pictures are drawn at a validation, counted from 1; more and more rarely without a total.

    Examples
    --------
    >>> [n for n in range(1, 26) if is_due(n, 25, 5)], [n for n in range(1, 26) if is_due(n, 0, 5)]
    ([1, 5, 10, 15, 20, 25], [1, 2, 4, 8, 16])
    """
    if total < 1:
        return number & (number - 1) == 0
    return number in (1, total) or number % -(-total // max(1, pictures)) == 0


def _map(loaded: LightningData, module: CSMModule) -> Figure:
    """Draw the map between the first and the last validation shape."""
    names = [loaded.data.validation_names[i] for i in (0, -1)]
    samples = [loaded.sample(name) for name in names]
    here, there = (module.describe(NetworkInput(sample.features, sample.surface)) for sample in samples)
    source, target = (loaded.data.shape(name).mesh for name in names)
    view = view_of_most(loaded.data.shape(name).mesh for name in loaded.data.train_names())
    return correspondence_figure(source, target, nearest(here, there), view=view)


def _filters(loaded: LightningData, module: CSMModule) -> dict[str, Figure]:
    """Draw the learned filters, if the network has any."""
    evals = loaded.sample(loaded.data.validation_names[0]).surface.basis.evals.to(module.device)
    with torch.no_grad():
        filters = {name: response.cpu().numpy() for name, response in module.network.filters(evals).items()}
    if not filters:
        return {}
    k = len(next(iter(filters.values())))
    return {"filters": filters_figure(evals[:k].cpu().numpy(), filters)}


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


def _results(trainer: L.Trainer) -> tuple[str, ...]:
    """Return the numbers that runs are compared by."""
    return (*(f"{metric_group(trainer)}/{name}" for name in _ERRORS), "train/loss")


def _logger(trainer: L.Trainer) -> TensorBoardLogger | None:
    if not trainer.is_global_zero:
        return None
    return next((logger for logger in trainer.loggers if isinstance(logger, TensorBoardLogger)), None)


def _data(trainer: L.Trainer) -> LightningData | None:
    data = trainer.datamodule  # type: ignore[attr-defined]
    return data if isinstance(data, LightningData) else None


def _errors(trainer: L.Trainer) -> ValidationErrors | None:
    return next((c for c in trainer.callbacks if isinstance(c, ValidationErrors)), None)  # type: ignore[attr-defined]
