"""The Hydra groups of conf/: every experiment composes and every name and key in it exists."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Iterator
from typing import Any

import pytest
import torch
from hydra import compose, initialize_config_dir
from hydra.utils import get_class, instantiate
from omegaconf import DictConfig, OmegaConf

from csm.commands.choices import config_folder
from csm.commands.groups import FILLED_IN, GROUPS, make_protocol
from csm.commands.main import COMMANDS
from csm.data.registry import DATA_SETS
from csm.descriptors import PRESETS
from csm.learning.module import CSMModule
from csm.networks import MODELS, NETWORKS, build, stencils_of
from tests.shapes import blob
from tests.surfaces import surface_of

CONF = config_folder()
for name in COMMANDS:  # the commands register the groups that they use
    importlib.import_module(f"csm.commands.{name.replace('-', '_')}")


def names(group: str) -> list[str]:
    return sorted(path.stem for path in (CONF / group).glob("*.yaml"))


def read(group: str, name: str) -> DictConfig:
    content = OmegaConf.load(CONF / group / f"{name}.yaml")
    assert isinstance(content, DictConfig)
    return content


MATRICES = [name for name in names("experiment") if "rows" in read("experiment", name)]
TRAININGS = [name for name in names("experiment") if name not in MATRICES]


@pytest.fixture(autouse=True)
def config_dir() -> Iterator[None]:
    with initialize_config_dir(str(CONF), version_base="1.3"):
        yield


def plain(cfg: Any) -> Any:
    return OmegaConf.to_container(cfg, resolve=True)


def accepted(cls: type) -> set[str]:
    """Return the keyword arguments of a class; ``**options`` are those of its base."""
    found: set[str] = set()
    for base in cls.__mro__:
        parameters = inspect.signature(base.__init__).parameters  # type: ignore[misc]
        found |= set(parameters)
        if not any(p.kind is inspect.Parameter.VAR_KEYWORD for p in parameters.values()):
            break
    return found


def module_of(cfg: DictConfig) -> CSMModule:
    descriptor = instantiate(cfg.descriptor)
    return CSMModule(
        network=plain(cfg.model),
        in_channels=48,
        n_classes=42,
        descriptor={"name": descriptor.name, **descriptor.parameters()},
        basis_k=cfg.data.basis_k,
        training={},
        **cfg.optimizer,
        **cfg.learning,
    )


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_a_configuration_that_composes(command):
    cfg = compose(command)
    assert {"debug", "store", "workers"} <= set(cfg)


@pytest.mark.parametrize("name", TRAININGS)
def test_an_experiment_makes_its_descriptor_network_and_protocol(name):
    cfg = compose("train", [f"experiment={name}"])
    module_of(cfg)
    assert cfg.model.get("ks", 0) <= cfg.data.basis_k
    assert make_protocol(cfg).distance == "exact", "numbers to be reported use exact geodesics"
    assert cfg.trainer.max_epochs > 0


@pytest.mark.parametrize("name", MATRICES)
def test_a_matrix_names_experiments_that_compose(name):
    cfg = compose("matrix", [f"experiment={name}"])
    assert cfg.rows
    for overrides in cfg.rows.values():
        module_of(compose("train", [*overrides, *cfg.overrides]))


@pytest.mark.parametrize("name", PRESETS)
def test_a_descriptor_of_the_group_is_the_preset_of_that_name(name):
    made = instantiate(compose("train", [f"descriptor={name}"]).descriptor)
    assert made == PRESETS[name]
    assert made.parameters() == PRESETS[name].parameters()


@pytest.mark.parametrize("name", sorted({*MODELS, *NETWORKS}))
def test_a_model_of_the_group_is_a_network_that_runs(name):
    options = plain(compose("train", [f"model={name}"]).model)
    network = build(**options, in_channels=5, n_classes=9).double()
    surface = surface_of(blob(3), 256, stencils_of(**options))
    assert network(torch.randn(642, 5).double(), surface).shape == (642, 9)


@pytest.mark.parametrize("name", DATA_SETS)
def test_a_data_set_of_the_group_has_all_arguments_of_its_class(name):
    content = GROUPS["data"]()[name]
    cls = get_class(str(content["_target_"]))
    assert set(content) - {"_target_"} == accepted(cls) - {*FILLED_IN}
    assert {"basis_k", "holdout", "split"} <= set(content)


@pytest.mark.parametrize("group", GROUPS)
def test_a_group_from_a_registry_has_no_files_beside_it(group):
    assert not (CONF / group).exists(), "two places for one default"


@pytest.mark.parametrize("name", names("recipe"))
def test_a_recipe_makes_a_network_on_its_input(name):
    module_of(compose("train", [f"recipe={name}"]))


@pytest.mark.parametrize("name", TRAININGS)
def test_an_experiment_splits_by_a_name(name):
    split = compose("train", [f"experiment={name}"]).data.get("split")
    assert split is None or "/" not in split
