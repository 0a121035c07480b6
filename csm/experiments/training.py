"""One training from its settings to a checkpoint, without Hydra."""

from __future__ import annotations

import logging
import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import lightning as L
import torch
from lightning.pytorch.loggers import Logger

from csm._locks import locked
from csm._signals import saying
from csm.data.base import DataModule
from csm.descriptors.base import record
from csm.errors import ConfigError
from csm.evaluation.provenance import provenance
from csm.experiments.callbacks import EpochLines, ValidationErrors
from csm.experiments.history import Curves, history_of
from csm.experiments.ranks import prepare_once, require_same_begin
from csm.experiments.resuming import AUTO, last_checkpoint, require_same_settings, resume_point
from csm.experiments.tensorboard import TensorBoardPanels
from csm.experiments.trainer import make_trainer, step_settings
from csm.learning.checkpoint import export_module
from csm.learning.describer import Describer
from csm.learning.loading import LightningData
from csm.learning.module import CSMModule
from csm.learning.places import template_of
from csm.learning.pretrained import origin, require_same_trunk, take_over
from csm.learning.samples import also_classes
from csm.learning.twins import learn_twins
from csm.matching.network import NetworkMethod, load_model

_log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Training:
    """Everything that a training depends on.

    Parameters
    ----------
    name
        What result rows call the trained method.
    data
        The data module.
    network
        Name and options of the network, for `csm.networks.build`.
    options
        Of `csm.learning.module.CSMModule`: learning rate, schedule, loss.
    trainer
        Makes Lightning's trainer, such as ``functools.partial(lightning.Trainer, max_epochs=20)``.
    seed
        Of all random choices.
    callbacks
        For the trainer, besides the one that keeps the last checkpoint.
    logger
        Called with ``save_dir=``; None for no log.
    settings
        All settings as plain data, for TensorBoard's table of hyper-parameters.
    pretrained
        A trained network whose weights it begins with, as `csm.load_model` takes it; None for weights that are drawn.
        The classifier is taken where the set is the same, else it is a new one.
    """

    name: str
    data: DataModule
    network: Mapping[str, Any]
    options: Mapping[str, Any] = field(default_factory=dict)
    trainer: Callable[..., L.Trainer] = L.Trainer
    seed: int = 0
    callbacks: Sequence[L.Callback] = field(default_factory=lambda: default_callbacks())
    logger: Callable[..., Logger] | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)
    pretrained: str | None = None

    @cached_property
    def source(self) -> Describer | None:
        """The trained network that it begins with."""
        return None if self.pretrained is None else load_model(self.pretrained).module

    @cached_property
    def begun(self) -> dict[str, Any]:
        """What the checkpoint says of that network, with the hash of its weights; empty without one."""
        if self.source is None:
            return {}
        return {"pretrained": origin(self.source) | {"weights": NetworkMethod(self.source).key["weights"]}}


@dataclass(frozen=True, eq=False)
class Trained:
    """A trained network, its checkpoint, and what was measured at the end and on the way; `rank` is of the process."""

    module: CSMModule
    checkpoint: Path
    seconds: float
    measured: Mapping[str, float]
    rank: int = 0
    curves: Curves = field(default_factory=dict)

    @property
    def parameters(self) -> int:
        """Number of weights of the network, with the classifier over the points of the template."""
        return sum(weights.numel() for weights in self.module.network.parameters())


def default_callbacks(seed: int = 0) -> list[L.Callback]:
    """Return the callbacks of ``csm train``: validation errors, TensorBoard's panels, a line per epoch."""
    return [ValidationErrors(seed=seed), TensorBoardPanels(), EpochLines()]


def fit(training: Training, folder: Path, resume: Path | str | None = AUTO) -> Trained:
    """Train, and save ``model.ckpt`` and ``export/`` in a folder.

    Parameters
    ----------
    training
        What is trained on what.
    folder
        Where checkpoints and logs go.
    resume
        A checkpoint to go on from; "auto" for the last one in the folder if there is one; None to begin anew.

    Raises
    ------
    DataError
        If training shapes cannot be used, or the checkpoint cannot be read.
    ConfigError
        If the settings do not fit each other or those of the checkpoint, or another training works in the folder.
    NumericalError
        If the loss is not finite.
    """
    folder.mkdir(parents=True, exist_ok=True)
    L.seed_everything(training.seed, workers=True, verbose=False)
    trainer = make_trainer(training, folder)
    with locked(folder, wait=0) if trainer.is_global_zero else nullcontext():
        return _fit(training, trainer, folder, resume)


def _fit(training: Training, trainer: L.Trainer, folder: Path, resume: Path | str | None) -> Trained:
    begin = resume_point(folder, resume)
    draft = sketch(training, trainer.max_epochs, step_settings(trainer))
    if begin:
        require_same_settings(begin, draft, trainer.max_epochs)
    elif trainer.max_epochs == 0 and next(draft.network.parameters(), None) is not None:
        _log.warning("trainer.max_epochs=0: nothing is trained; the weights are those that the training begins with")
    loaded = LightningData(training.data)
    prepare_once(trainer, loaded)
    require_same_begin(trainer, folder, begin)
    module = make_module(training, loaded.n_features, trainer.max_epochs, step_settings(trainer))
    if training.source is not None:
        with_classifier = take_over(module, training.source)
        _log.info(
            "begins with %s, %s", training.pretrained, "its classifier too" if with_classifier else "a new classifier"
        )
    elif module.inputs is not None:
        module.inputs.learn(sample.features for sample in loaded.fitted())
    if module.places is not None:
        template = template_of(loaded.sample(name) for name in training.data.fit_names)
        module.places.learn(template, training.data.shape(template.name).mesh)
    if trainer.global_rank:
        torch.manual_seed(training.seed + trainer.global_rank)  # weights and order are those of rank 0, dropout is not
    with saying(lambda: _what_is_kept(folder, trainer)), _interruptible():
        trainer.fit(module, datamodule=loaded, ckpt_path=begin, weights_only=True)
    history, ended = history_of(trainer), time.perf_counter()
    if module.places is not None and module.mirror:
        learn_twins(module, [loaded.sample(name) for name in training.data.fit_names])
    seconds = history.seconds + time.perf_counter() - ended
    module.hparams["training"]["epochs"] = trainer.current_epoch  # fewer than asked for where max_time ended it
    checkpoint = folder / "model.ckpt"
    trainer.save_checkpoint(checkpoint)
    if trainer.is_global_zero:
        export_module(module, folder / "export")
    measured = history.last | {key: float(value) for key, value in trainer.callback_metrics.items()}
    return Trained(module, checkpoint, seconds, measured, trainer.global_rank, history.curves)


def sketch(training: Training, epochs: int | None, steps: Mapping[str, Any] | None = None) -> CSMModule:
    """Make the module without memory for its weights: what does not fit fails here, before the preparation."""
    source = training.source
    try:
        with torch.device("meta"):
            made = make_module(training, 1 if source is None else source.settings["in_channels"], epochs, steps)
    except (IndexError, RuntimeError, TypeError, ZeroDivisionError) as error:
        options = ", ".join(f"{key}={value}" for key, value in training.network.items())
        raise ConfigError(f"model: no network can be made with {options} ({error})") from error
    if source is not None:
        require_same_trunk(made, source, str(training.pretrained))
    return made


def _what_is_kept(folder: Path, trainer: L.Trainer) -> str:
    last = last_checkpoint(folder)
    if not last.exists():
        return f"no epoch was finished, so nothing is kept of the training in {folder}"
    return (
        f"{trainer.current_epoch} of {trainer.max_epochs} epochs are done, and the last one is kept in {last}; the "
        f"same training in the same folder (hydra.run.dir={folder}) goes on from there"
    )


@contextmanager
def _interruptible() -> Iterator[None]:
    """Let Ctrl-C and SIGTERM through, which Lightning turns into the end of the process with status 1."""
    handler = signal.getsignal(signal.SIGINT)
    try:
        yield
    except SystemExit as ended:
        if isinstance(ended.__context__, KeyboardInterrupt):
            raise ended.__context__ from None
        raise
    finally:
        if threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGINT, handler)


def make_module(
    training: Training, n_features: int, epochs: int | None = None, steps: Mapping[str, Any] | None = None
) -> CSMModule:
    """Make the untrained module of a training for input features of this width.

    Its hyper-parameters tell the number of `epochs`, and what the trainer makes of a step (`step_settings`).
    """
    data, made = training.data, provenance()
    return CSMModule(
        network=dict(training.network),
        in_channels=n_features,
        n_classes=data.n_classes,
        descriptor=record(data.recipe.descriptor),
        basis_k=data.recipe.basis_k,
        also_classes=also_classes(data, bool(training.options.get("mirror"))),
        **training.options,
        training={
            "name": training.name,
            "set": data.train_set.name,
            "also": [more.label for more in data.also],
            "protocol": data.protocol,
            "seed": training.seed,
            "epochs": epochs,
            **(steps or {}),
            **training.begun,
            "command": made.command,
            "commit": made.commit,
        },
    )
