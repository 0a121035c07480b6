"""Going on with a training that was stopped, as if it had not been: whole checkpoints, random states, same settings."""

from __future__ import annotations

import logging
import random
from collections.abc import Mapping
from inspect import signature
from pathlib import Path
from typing import Any

import lightning as L
import numpy as np
import torch
from lightning.fabric.plugins import TorchCheckpointIO
from torch import distributed

from csm.errors import ConfigError, DataError
from csm.learning.checkpoint import read_checkpoint
from csm.learning.module import CSMModule
from csm.mesh.io import atomic_path

_log = logging.getLogger(__name__)

AUTO = "auto"
"""Go on from the last checkpoint in the folder if there is one, else begin."""

_FREE = ("in_channels", "training.epochs", "training.command", "training.commit", "training.name")  # what may differ
_PER_STEP = "training.shapes_per_step"  # checkpoints that do not say it have 1
_OF_TRAINER = {
    _PER_STEP: _PER_STEP,
    "training.gradient_clip_val": "trainer.gradient_clip_val",
    "training.limit_train_batches": "trainer.limit_train_batches",
}
_CALLED = _OF_TRAINER | {"training.epochs": "trainer.max_epochs, over which the schedule is laid out"}
_FIXED_LENGTH = ("cosine", "step", "drop", "one_cycle")  # schedules that are laid out over all epochs


def last_checkpoint(folder: Path) -> Path:
    """Return where the last epoch of a training in this folder is kept, so that it can go on from there."""
    return folder / "checkpoints" / "last.ckpt"


class WholeCheckpoints(TorchCheckpointIO):
    """Checkpoints that are written beside their place and renamed, so that a kill leaves the one before."""

    def save_checkpoint(self, checkpoint: dict[str, Any], path: Any, storage_options: Any | None = None) -> None:
        """Write a checkpoint under a temporary name in its folder, then rename it."""
        with atomic_path(path) as temporary:
            torch.save(checkpoint, temporary)


class RandomStates(L.Callback):
    """Keep the states of all random generators in the checkpoint, and set them again when a training goes on.

    The order of the shapes, the vertices drawn for the loss and dropout are then those of the training that was not
    stopped.  Where several processes train together, each has states of its own; on another number of devices, rank 0
    goes on with its own and the others draw anew.
    """

    def state_dict(self) -> dict[str, Any]:
        """Return the states of PyTorch, CUDA, NumPy and Python as tensors and plain data, those of all ranks."""
        mine = self._mine()
        if not distributed.is_initialized() or distributed.get_world_size() == 1:
            return mine
        every: list[Any] = [None] * distributed.get_world_size()
        distributed.all_gather_object(every, mine)
        return {**mine, "ranks": every}

    def _mine(self) -> dict[str, Any]:
        kind, keys, position, has_gauss, cached = np.random.get_state()  # noqa: NPY002 - libraries use this generator
        version, internal, gauss = random.getstate()
        return {
            "torch": torch.get_rng_state(),
            "cuda": torch.cuda.get_rng_state_all() if torch.cuda.is_available() else [],
            "numpy": [str(kind), torch.as_tensor(np.asarray(keys, dtype=np.int64)), position, has_gauss, cached],
            "python": [version, list(internal), gauss],
        }

    def load_state_dict(self, state_dict: dict[str, Any]) -> None:
        """Set all generators of this rank."""
        ranks = distributed.get_world_size() if distributed.is_initialized() else 1
        rank = distributed.get_rank() if distributed.is_initialized() else 0
        kept = state_dict.get("ranks", [state_dict])
        if len(kept) == ranks:
            self._set(kept[rank])
        elif rank == 0:
            _log.warning("going on with %d processes after %d: random draws differ from then on", ranks, len(kept))
            self._set(kept[0])

    def _set(self, state_dict: Mapping[str, Any]) -> None:
        torch.set_rng_state(state_dict["torch"].cpu())
        if torch.cuda.is_available() and len(state_dict["cuda"]) == torch.cuda.device_count():
            torch.cuda.set_rng_state_all([state.cpu() for state in state_dict["cuda"]])
        kind, keys, *rest = state_dict["numpy"]
        np.random.set_state((kind, keys.numpy().astype(np.uint32), *rest))  # noqa: NPY002
        version, internal, gauss = state_dict["python"]
        random.setstate((version, tuple(internal), gauss))


def resume_point(folder: Path, resume: Path | str | None) -> Path | None:
    """Return the checkpoint to go on from.

    Parameters
    ----------
    folder
        Of the training.
    resume
        A checkpoint; "auto" for the last one in the folder, if it is there and sound; None to begin.

    Raises
    ------
    DataError
        If a checkpoint that is named is missing or damaged.
    """
    if resume is None:
        return None
    if resume != AUTO:
        if Path(resume).suffix in (".json", ".safetensors"):
            raise DataError(
                f"{resume}: an export has the weights alone, and a training goes on from a checkpoint such as "
                f"{last_checkpoint(Path('FOLDER'))}; pretrained={resume} begins another with these weights"
            )
        read_checkpoint(Path(resume))
        return Path(resume)
    last = last_checkpoint(folder)
    if not last.exists():
        return None
    try:
        read_checkpoint(last)
    except DataError as error:
        _log.warning("%s; the training begins again", error)
        return None
    return last


def require_same_settings(path: Path, module: CSMModule, epochs: int | None = None) -> None:
    """Raise if a checkpoint was trained with other settings than those of a module that is to go on from it.

    Parameters
    ----------
    path
        The checkpoint.
    module
        The module that would go on.
    epochs
        How many epochs it is to be trained for; other numbers are refused where the schedule is laid out over them.
        None to leave that out.

    Raises
    ------
    ConfigError
        With the settings that differ, or if more epochs are done than are wanted.
    """
    read = read_checkpoint(path)
    kept, wanted = _flat(read["hyper_parameters"]), _flat(module.hparams)
    known = signature(CSMModule).parameters.items()  # a checkpoint of an older csm lacks what came after it
    kept = {name: option.default for name, option in known if name in wanted} | kept
    differing = sorted(key for key in kept.keys() | wanted.keys() if kept.get(key) != wanted.get(key))
    changed = [key for key in differing if key not in _FREE]
    if _PER_STEP not in wanted:  # the module was made without a trainer
        changed = [key for key in changed if key not in _OF_TRAINER]
    elif wanted[_PER_STEP] == kept.get(_PER_STEP, 1):
        changed = [key for key in changed if key != _PER_STEP]
    if epochs is not None and module.schedule in _FIXED_LENGTH and kept.get("training.epochs") not in (None, epochs):
        changed.append("training.epochs")
    if changed:
        told = "; ".join(f"{_CALLED.get(key, key)}: {kept.get(key)} there, {wanted.get(key)} wanted" for key in changed)
        raise ConfigError(
            f"{path}: was trained with other settings ({told}); go on with those, or begin anew (resume=null, or "
            "another folder)"
        )
    if epochs is not None and (done := epochs_done(read)) > epochs >= 0:
        raise ConfigError(
            f"{path}: {done} epochs are done there, trainer.max_epochs={epochs} wants fewer; ask for more, or "
            "begin anew (resume=null, or another folder)"
        )


def epochs_done(checkpoint: Mapping[str, Any]) -> int:
    """Return how many epochs a training had done when it wrote this checkpoint."""
    progress = checkpoint.get("loops", {}).get("fit_loop", {}).get("epoch_progress", {}).get("current", {})
    return int(progress.get("processed", 0))


def _flat(node: Mapping[str, Any], above: str = "") -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in node.items():
        if isinstance(value, Mapping):
            found |= _flat(value, f"{above}{key}.")
        else:
            found[f"{above}{key}"] = list(value) if isinstance(value, tuple) else value
    return found
