"""``csm bench descriptors``, ``networks`` and ``matching``: measure what things cost, by the studies that do."""

from __future__ import annotations

from csm.commands.main import run_as_program

if __name__ == "__main__":
    run_as_program(__file__)

from typing import Any

from omegaconf import DictConfig

from csm.commands.app import command
from csm.commands.choices import BENCHES
from csm.commands.reproduce import make_studies
from csm.errors import ConfigError


def run(cfg: DictConfig) -> dict[str, Any]:
    """Make the study of every bench of ``targets``."""
    unknown = [name for name in cfg.targets if name not in BENCHES]
    if unknown or not cfg.targets:
        raise ConfigError(f"bench: {', '.join(unknown) or 'nothing'} to measure; there is {', '.join(BENCHES)}")
    return make_studies(cfg, [BENCHES[name] for name in cfg.targets])


main = command("bench")(run)
