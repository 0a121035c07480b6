"""The Hydra groups of conf/: every experiment composes and every name and key in it exists."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import torch
from hydra import compose, initialize_config_dir
from hydra.utils import get_class, instantiate
from omegaconf import DictConfig, OmegaConf

from csm.commands.app import config_folder
from csm.commands.main import COMMANDS
from csm.commands.testing import protocol_of
from csm.data.splits import read_split
from csm.descriptors import PRESETS
from csm.learning.module import CSMModule
from csm.networks import build, stencils_of
from tests.shapes import blob
from tests.surfaces import surface_of

CONF = config_folder()
FILLED_IN_BY_COMMANDS = {"self", "descriptor", "store", "workers", "options", "train_set", "test_sets"}


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
    assert protocol_of(cfg.metric).distance == "exact", "numbers to be reported use exact geodesics"
    assert cfg.trainer.max_epochs > 0


@pytest.mark.parametrize("name", MATRICES)
def test_a_matrix_names_experiments_that_compose(name):
    cfg = compose("matrix", [f"experiment={name}"])
    assert cfg.rows
    for overrides in cfg.rows.values():
        module_of(compose("train", [*overrides, *cfg.overrides]))


@pytest.mark.parametrize("name", names("descriptor"))
def test_a_descriptor_file_is_the_preset_of_that_name(name):
    made = instantiate(compose("train", [f"descriptor={name}"]).descriptor)
    assert made == PRESETS[name]
    assert made.parameters() == PRESETS[name].parameters()


@pytest.mark.parametrize("name", names("model"))
def test_a_model_file_makes_a_network_that_runs(name):
    options = plain(compose("train", [f"model={name}"]).model)
    network = build(**options, in_channels=5, n_classes=9).double()
    surface = surface_of(blob(3), 128, stencils_of(**options))
    assert network(torch.randn(642, 5).double(), surface).shape == (642, 9)


@pytest.mark.parametrize("name", names("data"))
def test_a_data_file_names_a_class_and_keys_that_it_takes(name):
    content = read("data", name)
    cls = get_class(content["_target_"])
    given = set(content) - {"_target_"}
    assert given <= accepted(cls) - FILLED_IN_BY_COMMANDS, f"{cls.__name__} does not take all of {sorted(given)}"


@pytest.mark.parametrize("path", sorted((CONF / "split").glob("*.json")), ids=lambda path: path.stem)
def test_a_split_file_can_be_read_and_does_not_test_on_training_shapes(path: Path):
    split = read_split(path)
    assert split.train
    assert split.test
    assert not set(split.train) & set(split.test)


@pytest.mark.parametrize("name", TRAININGS)
def test_an_experiment_splits_by_a_file_that_is_shipped(name):
    split = compose("train", [f"experiment={name}"]).data.get("split")
    assert split is None or CONF in Path(split).parents
