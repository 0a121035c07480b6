"""The configuration groups: those made from csm's registries (data, descriptor, model), and what is made of them.

Every default stands once, in the class that it belongs to; a descriptor, network or data set in its registry can be
chosen on the command line without a yaml file.  Files of the same groups in a folder of your own (``--config-dir``)
come beside them.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import TYPE_CHECKING, Any

from hydra.core.config_store import ConfigStore
from hydra.utils import instantiate
from omegaconf import DictConfig, OmegaConf

from csm.commands.choices import model_names
from csm.data.store import Store
from csm.errors import ConfigError

if TYPE_CHECKING:
    from csm.data.base import DataModule
    from csm.data.prepare import Recipe
    from csm.evaluation.protocol import EvaluationProtocol

FILLED_IN = ("self", "train_set", "test_sets", "descriptor", "store", "workers", "stencils", "options")
"""Arguments of data modules that commands give, so that they are no options."""


def register(*groups: str) -> None:
    """Put the configurations of these groups into Hydra's store."""
    store = ConfigStore.instance()
    for group in groups:
        for name, node in GROUPS[group]().items():
            store.store(name=name, node=dict(node), group=group, provider="csm")


def descriptor_configs() -> dict[str, Mapping[str, Any]]:
    """Return the presets of descriptors: the class and all its parameters."""
    from csm.descriptors.presets import PRESETS

    return {name: _descriptor_config(descriptor) for name, descriptor in PRESETS.items()}


def _descriptor_config(descriptor: Any) -> dict[str, Any]:
    found = {f.name: _plain(getattr(descriptor, f.name)) for f in fields(descriptor)}
    if "parts" in found:
        parts = {name: _descriptor_config(part) for name, part in found["parts"].items()}
        found = {"_convert_": "all", "parts": parts}  # Hydra would hand over a configuration of descriptors
    return {"_target_": f"csm.descriptors.{type(descriptor).__name__}", **found}


def model_configs() -> dict[str, Mapping[str, Any]]:
    """Return the named settings of networks, and every network by its own name."""
    from csm.networks import settings

    return {name: settings(name) for name in model_names()}


def data_configs() -> dict[str, Mapping[str, Any]]:
    """Return the data modules with the defaults of their arguments; one without a default has to be given."""
    from csm.data.registry import DATA_SETS, data_set

    found: dict[str, Mapping[str, Any]] = {}
    for name in DATA_SETS:
        cls = data_set(name).module
        found[name] = {"_target_": f"{cls.__module__}.{cls.__qualname__}", **_arguments(cls)}
    return found


GROUPS: Mapping[str, Callable[[], dict[str, Mapping[str, Any]]]] = {
    "data": data_configs,
    "descriptor": descriptor_configs,
    "model": model_configs,
}


def _arguments(cls: Any) -> dict[str, Any]:
    """Return the arguments of a class and, where it passes others on, of its bases, with their defaults."""
    found: dict[str, Any] = {}
    for base in cls.__mro__:
        parameters = inspect.signature(base.__init__).parameters
        for name, parameter in parameters.items():
            if name not in FILLED_IN and parameter.kind is not parameter.VAR_KEYWORD:
                default = "???" if parameter.default is parameter.empty else _plain(parameter.default)
                found.setdefault(name, default)
        if not any(p.kind is p.VAR_KEYWORD for p in parameters.values()):
            break
    return found


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value


def plain(cfg: Any) -> Any:
    """Return a node of the configuration as plain data, with its references resolved."""
    return OmegaConf.to_container(cfg, resolve=True) if OmegaConf.is_config(cfg) else cfg


def make_data(cfg: DictConfig, recipe: Recipe | None = None) -> DataModule:
    """Make the data module of the data group.

    Parameters
    ----------
    cfg
        Has the groups and options of the command.
    recipe
        What a trained network needs of a shape; by default what the descriptor, data and model groups say.
    """
    if recipe is None:
        from csm.data.prepare import Recipe
        from csm.learning.samples import stencils_for

        recipe = Recipe(instantiate(cfg.descriptor), int(cfg.data.basis_k), stencils_for(plain(cfg.model)))
    data: DataModule = instantiate(cfg.data, _partial_=True)(
        descriptor=recipe.descriptor,
        basis_k=recipe.basis_k,
        stencils=recipe.stencils,
        store=Store(cfg.store),
        workers=cfg.workers,
    )
    if cfg.get("clean") == "auto":
        from csm.data.cleaned import CleanedSet

        data.train_set = CleanedSet(data.train_set)
        data.test_sets = {name: CleanedSet(shapes) for name, shapes in data.test_sets.items()}
    return data


def matching_of(cfg: DictConfig) -> list[str]:
    """Return the names of the matchers, each with each refiner such as "nearest+joint"; ConfigError if one is unknown.

    A single name may stand without brackets.
    """
    from csm.matching.registry import matchers

    def listed(value: Any) -> list[str]:
        return [value] if isinstance(value, str) else list(plain(value) or [])

    return [each.name for each in matchers(listed(cfg.matching), listed(cfg.refine))]


def make_protocol(cfg: DictConfig) -> EvaluationProtocol:
    """Make the protocol of the metric group; ConfigError if it has an unknown option."""
    from csm.evaluation.protocol import EvaluationProtocol

    try:
        return EvaluationProtocol(**plain(cfg.metric))
    except TypeError as error:
        raise ConfigError(f"metric: {error}") from error
