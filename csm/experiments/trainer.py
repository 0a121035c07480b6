"""Lightning's trainer for a training: its callbacks, log, checkpoints, and what of its settings does not fit."""

from __future__ import annotations

import logging
import sys
import tempfile
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

import lightning as L
from lightning.fabric.utilities.exceptions import MisconfigurationException
from lightning.pytorch.callbacks import ModelCheckpoint
from lightning.pytorch.loggers import CSVLogger, Logger, TensorBoardLogger

from csm._extras import install_line
from csm.errors import ConfigError
from csm.experiments.callbacks import FiniteLoss, require_monitored
from csm.experiments.history import History
from csm.experiments.ranks import SharedStatistics, require_one_or_ranks, require_single_precision
from csm.experiments.resuming import RandomStates, WholeCheckpoints, last_checkpoint
from csm.experiments.tensorboard import TensorBoardPanels

if TYPE_CHECKING:
    from csm.experiments.training import Training


def make_trainer(training: Training, folder: Path) -> L.Trainer:
    """Make the trainer of a training in a folder; ConfigError if its settings do not fit each other or this machine.

    Lightning's bar needs a terminal, elsewhere `EpochLines` takes its place.
    """
    _quiet_lightning()
    require_monitored(training.callbacks, training.data)
    last = last_checkpoint(folder)
    keep = ModelCheckpoint(last.parent, filename=last.stem, enable_version_counter=False, save_on_train_epoch_end=True)
    for callback in training.callbacks:
        if isinstance(callback, TensorBoardPanels) and not callback.hparams:
            callback.hparams = training.settings
    try:
        trainer = _trainer(training, folder, keep)
    except (ValueError, TypeError, MisconfigurationException) as error:
        raise ConfigError(f"trainer: {' '.join(str(error).split())}") from error
    require_one_or_ranks(trainer)
    require_single_precision(trainer)
    return trainer


def shapes_per_step(trainer: L.Trainer) -> int:
    """Return over how many shapes the gradient of one step is taken."""
    return int(trainer.accumulate_grad_batches) * trainer.world_size


def step_settings(trainer: L.Trainer) -> dict[str, Any]:
    """Return what the trainer decides of the steps; what it leaves as it is by default is not in it."""
    found: dict[str, Any] = {"shapes_per_step": shapes_per_step(trainer)}
    if trainer.gradient_clip_val is not None:
        found["gradient_clip_val"] = trainer.gradient_clip_val
    if isinstance(limit := trainer.limit_train_batches, int) or limit != 1.0:  # 1 is one batch, 1.0 all of them
        found["limit_train_batches"] = limit
    return found


def _trainer(training: Training, folder: Path, keep: ModelCheckpoint) -> L.Trainer:
    return training.trainer(
        callbacks=[SharedStatistics(), *training.callbacks, RandomStates(), FiniteLoss(), History(), keep],
        use_distributed_sampler=False,  # the data share themselves out
        plugins=[WholeCheckpoints()],
        logger=_make_logger(training, folder),
        default_root_dir=folder,
        **({} if sys.stdout.isatty() else {"enable_progress_bar": False}),
    )


def _make_logger(training: Training, folder: Path) -> Logger | bool:
    if training.logger is None:
        return False
    try:
        with tempfile.TemporaryDirectory(prefix="csm-") as elsewhere:  # what it refuses, it refuses when it writes
            tried = training.logger(save_dir=elsewhere)
            if isinstance(tried, TensorBoardLogger | CSVLogger):  # others may begin a run somewhere
                _ = tried.experiment
        return training.logger(save_dir=folder)
    except ModuleNotFoundError as error:
        extra = next((name for name in ("wandb", "mlflow") if name in str(error)), "")
        how = install_line(extra) if extra else "pip install it"
        raise ConfigError(f"logger: a library is not installed; {how}, or choose logger=csv ({error})") from error
    except TypeError as error:
        raise ConfigError(f"logger: {error}") from error


def _quiet_lightning() -> None:
    """Keep Lightning's hints and advertisements out of the output; its warnings stay."""
    logging.getLogger("lightning.pytorch").setLevel(logging.WARNING)
    logging.getLogger("lightning.fabric").setLevel(logging.WARNING)
    warnings.filterwarnings("ignore", message=r".*LeafSpec.*is deprecated")
    warnings.filterwarnings("ignore", message=r".*does not have many workers.*")
    warnings.filterwarnings("ignore", message=r"The dirpath has changed")
    warnings.filterwarnings("ignore", message=r"Checkpoint directory .* exists and is not empty")
