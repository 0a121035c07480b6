"""``csm train``: train a network on one set, then test it on every test set of its data module."""

from __future__ import annotations

from csm.commands.main import run_as_program

if __name__ == "__main__":
    run_as_program(__file__)

from typing import Any

from omegaconf import DictConfig

from csm.commands.app import command
from csm.commands.groups import register
from csm.errors import ConfigError

register("data", "descriptor", "model")


def run(cfg: DictConfig) -> dict[str, Any] | None:
    """Train and test; Lightning, which takes seconds to load, is loaded when the options are known to be right."""
    if "rows" in cfg:
        raise ConfigError("the experiment is a table of several trainings (rows); csm matrix fills it")
    from csm.commands.training import train

    return train(cfg)


main = command("train", folder=True, kept=("model.ckpt", "export/model.json"))(run)
