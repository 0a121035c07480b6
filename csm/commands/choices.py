"""What can be chosen: the folder of the configuration, and the names of the options of its groups.

Nothing that is chosen is imported here, nor Hydra, so that ``csm COMMAND --help`` is quick.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any


def config_folder() -> Path:
    """Return the folder of the Hydra groups: inside the installed package, or beside it in a checkout."""
    package = Path(__file__).resolve().parent.parent
    inside = package / "conf"
    return inside if inside.is_dir() else package.parent / "conf"


def descriptor_names() -> Iterable[str]:
    """Return the names of the presets of descriptors."""
    from csm.descriptors.presets import PRESETS

    return PRESETS


def model_names() -> Iterable[str]:
    """Return the named settings of networks, and every network by its own name."""
    from csm.networks.registry import MODELS, NETWORKS

    return dict.fromkeys([*MODELS, *NETWORKS])


def data_names() -> Iterable[str]:
    """Return the names of the data sets."""
    from csm.data.registry import DATA_SETS

    return DATA_SETS


NAMES: Mapping[str, Callable[[], Iterable[str]]] = {
    "data": data_names,
    "descriptor": descriptor_names,
    "model": model_names,
}
"""Groups that are made from csm's registries -> the names in them."""

BENCHES = {"descriptors": "table2", "networks": "table6", "matching": "benchmark_peers"}
"""What ``csm bench`` can measure, with the study that does it."""


def options_of(group: str, command: str = "") -> list[str]:
    """Return the names that can be chosen of a group: those from a registry, and those of yaml files.

    Of experiments, `csm matrix` is offered tables of several rows, and other commands single trainings.

    Examples
    --------
    >>> options_of("data")[:2], options_of("logger")
    (['humans', 'faust'], ['csv', 'mlflow', 'none', 'tensorboard', 'wandb'])
    >>> "table4" in options_of("experiment", "train"), "table4" in options_of("experiment", "matrix")
    (False, True)
    """
    made = NAMES[group]() if group in NAMES else ()
    files = sorted(path.stem for path in (config_folder() / group).glob("*.yaml"))
    names = list(dict.fromkeys([*made, *files]))
    if group != "experiment" or not command:
        return names
    return [name for name in names if is_table(name) == (command == "matrix")]


def is_table(experiment: str) -> bool:
    """Tell whether an experiment is a table of several rows, which `csm matrix` fills; one that is not known is none.

    Examples
    --------
    >>> is_table("table4"), is_table("faust")
    (True, False)
    """
    file = config_folder() / "experiment" / f"{experiment}.yaml"
    return file.is_file() and any(line.startswith("rows:") for line in file.read_text(encoding="utf-8").splitlines())


def own_settings(experiment: str, group: str) -> tuple[str | None, list[str]]:
    """Return what an experiment chooses of a group, and which settings of that choice it has; None if it chooses none.

    Examples
    --------
    >>> own_settings("demo", "data"), own_settings("demo", "descriptor")
    (('humans', ['test', 'split']), ('acd_paper', ['angles']))
    >>> own_settings("faust", "data"), own_settings("of_my_own", "data")
    (('faust', []), (None, []))
    """
    from omegaconf import OmegaConf

    file = config_folder() / "experiment" / f"{experiment}.yaml"
    content: Any = OmegaConf.to_container(OmegaConf.load(file)) if file.is_file() else {}
    defaults = [item for item in content.get("defaults", ()) if isinstance(item, dict)]
    chosen = next((item[f"override /{group}"] for item in defaults if f"override /{group}" in item), None)
    return chosen, [key for key in content.get(group, ()) if group != "data" or key not in _OF_ALL_DATA]


_OF_ALL_DATA = ("basis_k", "holdout", "also", "test_forms")
"""Settings of data that mean the same whatever the set."""
