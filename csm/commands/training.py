"""What ``csm train`` does once its options are read, and the trainings that other commands make of a configuration."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any

from hydra import compose
from hydra.core.hydra_config import HydraConfig
from hydra.types import RunMode
from hydra.utils import instantiate
from omegaconf import DictConfig

from csm._counts import counted
from csm.commands.app import output_folder
from csm.commands.groups import make_data, make_protocol, matching_of, plain
from csm.commands.outputs import require_results
from csm.commands.processes import is_first, processes_to_start, train_together
from csm.commands.tested import conclude
from csm.data.base import DataModule
from csm.data.inspection import require_sound
from csm.errors import ConfigError
from csm.experiments.callbacks import ValidationErrors
from csm.experiments.ranks import NAME, part
from csm.experiments.report import training_section
from csm.experiments.resuming import AUTO, resume_point
from csm.experiments.testing import measure_all, numbers, require_same_test
from csm.experiments.training import Training, fit
from csm.learning.loading import FITTED, UNSEEN
from csm.matching.base import require_device
from csm.matching.network import NetworkMethod

GROUPS = ("seed", "data", "descriptor", "model", "optimizer", "learning", "trainer")
"""What TensorBoard compares runs by."""


def train(cfg: DictConfig) -> dict[str, Any] | None:
    """Train and, unless ``test=false``, test; return the numbers of the job, or None in a process that only helps."""
    folder = output_folder()
    require_network_of_recipe(cfg, HydraConfig.get().overrides.task)
    training, protocol, matching = make_training(cfg), make_protocol(cfg), matching_of(cfg)
    require_objective(cfg, training)
    require_device(cfg.device)
    require_results(cfg.results)
    _ = training.source  # read now, so that a wrong path is told at once
    if cfg.test:
        require_same_test(folder, training.data, protocol, matching)
    if cfg.resume not in (None, AUTO):
        resume_point(folder, cfg.resume)
    require_sound(training.data, test=cfg.test, exact=protocol.distance == "exact" and not protocol.fallback)
    if processes := processes_to_start(training, folder):
        return train_together(processes, folder)
    if is_first() or cfg.trainer.get("strategy") != NAME:
        tests = counted(len(training.data.split.test), "test shape")
        begins = f"; begins with the weights of {training.pretrained}" if training.pretrained else ""
        print(f"{training.name}: {trained_how(cfg, training.data)}; {tests}{begins}", flush=True)
    trained = fit(training, folder, cfg.resume)
    if HydraConfig.get().mode == RunMode.RUN:  # the jobs of a sweep that torchrun started go on together
        part()
    if trained.rank:
        return None
    about = {"seconds": trained.seconds, "parameters": trained.parameters, "checkpoint": str(trained.checkpoint)}
    print(f"trained for {trained.seconds / 60:.1f} minutes, {trained.parameters:,} parameters: {trained.checkpoint}")
    found = {**about, **trained.measured}
    if not cfg.test:
        return with_objective(found, cfg.objective)
    method = NetworkMethod(trained.module)
    tested = measure_all(method, training.data, protocol, matching=matching, table=cfg.table, device=cfg.device)
    conclude(cfg, tested, f"{training.name}: {trained_how(cfg, training.data)}.", [training_section(trained)])
    if training.logger is not None:
        print(f"log:          {folder}  (tensorboard --logdir {folder})")
    return with_objective(found | numbers(tested), cfg.objective)


_NUMBERS = ("val/", "fit/", "train/", "step/", "age/", "exact/", "seconds", "parameters")
_MEASURED = tuple(f"{group}/{name}" for group in (UNSEEN, FITTED) for name in ("age", "exact", "far", "flip"))


def trained_how(cfg: DictConfig, data: DataModule) -> str:
    """Return one sentence: what is fitted, and what is validated on if the training gets to its first validation."""
    if not ends_before_validation(cfg):
        return data.protocol
    every, epochs = cfg.trainer.check_val_every_n_epoch, cfg.trainer.max_epochs
    return (
        f"{data.fitting}, not validated, as trainer.check_val_every_n_epoch={every} is more than "
        f"trainer.max_epochs={epochs}"
    )


def ends_before_validation(cfg: DictConfig) -> bool:
    """Tell whether a training has fewer epochs than there are to its first validation."""
    every, epochs = cfg.trainer.check_val_every_n_epoch, cfg.trainer.max_epochs
    return bool(every and epochs and 0 < epochs < every)


def require_objective(cfg: DictConfig, training: Training) -> None:
    """Raise a ConfigError if the objective of a sweep is a number that the training will not have."""
    if cfg.objective is None:
        return
    name = str(cfg.objective)
    if not name.startswith(_NUMBERS):
        raise ConfigError(
            f"objective={name}: no job has a number of that name; wanted one such as val/age, fit/age, train/loss, "
            "age/SET, exact/SET or seconds"
        )
    if name in _MEASURED and not any(isinstance(each, ValidationErrors) for each in training.callbacks):
        raise ConfigError(f"objective={name}: the callback that measures it was left out; wanted callbacks=default")
    if name.startswith(f"{UNSEEN}/"):
        data = training.data
        if not data.validates_unseen or len(data.validation_names) < 2:
            raise ConfigError(
                f"objective={name}: no two shapes are held out to validate on, so there is no such number; "
                "data.holdout=10 holds ten of the training shapes out"
            )
        if ends_before_validation(cfg):
            every, epochs = cfg.trainer.check_val_every_n_epoch, cfg.trainer.max_epochs
            raise ConfigError(
                f"objective={name}: trainer.check_val_every_n_epoch={every} validates later than the last of "
                f"trainer.max_epochs={epochs}; wanted at most {epochs}"
            )
    if name.startswith("age/") and not cfg.test:
        raise ConfigError(f"objective={name}: test=false leaves it out; wanted test=true, or objective={UNSEEN}/age")


def with_objective(found: dict[str, Any], name: str | None) -> dict[str, Any]:
    """Return the numbers of a job and, as "objective", the one that a sweeper makes small, where it is there."""
    if name is None:
        return found
    if not isinstance(value := found.get(name), int | float):
        known = ", ".join(key for key, value in found.items() if isinstance(value, int | float))
        print(f"csm: objective={name}: the job has no such number; it has {known}", file=sys.stderr)
        return found
    return {**found, "objective": value}


def make_training(cfg: DictConfig) -> Training:
    """Make the training of a configuration; a group that was left out (``~logger``, ``callbacks=null``) is empty."""
    logger, callbacks = cfg.get("logger"), cfg.get("callbacks") or {}
    settings = plain(cfg)
    return Training(
        name=str(cfg.name or plain(cfg.model)["name"]),
        data=make_data(cfg),
        network=plain(cfg.model),
        options={**plain(cfg.optimizer), **plain(cfg.learning)},
        trainer=instantiate(cfg.trainer, _partial_=True),
        seed=int(cfg.seed),
        callbacks=[_callback(name, callback) for name, callback in callbacks.items() if callback],
        logger=instantiate(logger, _partial_=True) if logger else None,
        settings={name: settings[name] for name in GROUPS},
        pretrained=None if cfg.pretrained is None else str(cfg.pretrained),
    )


def _callback(name: object, node: Any) -> Any:
    if not isinstance(node, DictConfig):
        raise ConfigError(f"callbacks.{name}={node}: wanted a class and its options, {{_target_: PLACE, ...}}")
    return instantiate(node)


def require_network_of_recipe(cfg: DictConfig, overrides: Sequence[str]) -> None:
    """Refuse an experiment that puts another network in the place of the one that a recipe is for.

    Parameters
    ----------
    cfg
        What the overrides made.
    overrides
        As on the command line, such as ``recipe=acscnn``.
    """
    chosen = {group: value for group, _, value in (text.partition("=") for text in overrides)}
    recipe, experiment = chosen.get("recipe", "null"), chosen.get("experiment", "null")
    if "null" in (recipe, experiment):
        return
    wanted = compose(
        "train", [f"{group}={chosen[group]}" for group in ("recipe", "model") if group in chosen]
    ).model.name
    if cfg.model.name != wanted:
        raise ConfigError(
            f"recipe={recipe} trains {wanted}, but experiment={experiment} chooses {cfg.model.name}, which would be "
            "trained at the rate of the recipe; take one of the two, or an experiment that leaves the network open, "
            "such as faust_rival or humans_rival"
        )
