"""What every command shares: where the configuration lies, how errors reach the user, what a job leaves behind."""

from __future__ import annotations

import functools
import json
import logging
import sys
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

import hydra
from hydra.core.hydra_config import HydraConfig
from hydra.types import RunMode
from hydra.utils import instantiate
from omegaconf import DictConfig, OmegaConf

from csm.data.datamodule import CorrespondenceDataModule
from csm.data.store import Store
from csm.errors import CsmError
from csm.learning.meshes import stencils_for
from csm.mesh.io import atomic_path

Run = Callable[[DictConfig], dict[str, Any]]

_log = logging.getLogger(__name__)


def config_folder() -> Path:
    """Return the folder of the Hydra groups: inside the installed package, or beside it in a checkout."""
    package = Path(__file__).resolve().parent.parent
    inside = package / "conf"
    return inside if inside.is_dir() else package.parent / "conf"


OmegaConf.register_new_resolver("conf", lambda inner: str(config_folder() / inner), replace=True)


def output_folder() -> Path:
    """Return the folder of the running Hydra job."""
    return Path(HydraConfig.get().runtime.output_dir)


def write_json(path: Path, content: Any) -> None:
    """Write json under a temporary name, then rename it."""
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps(content, indent=1, allow_nan=True) + "\n")


def command(config_name: str) -> Callable[[Run], Callable[[], Any]]:
    """Turn ``run(cfg) -> dict of floats`` into a Hydra command.

    An error that the user can mend is printed as one paragraph and ends the process with status 2; with
    ``debug=true`` its traceback is shown.  In a multirun a failing job is recorded and the sweep goes on.
    Every job writes what it returned to ``result.json`` in its folder.
    """

    def decorate(run: Run) -> Callable[[], Any]:
        @hydra.main(version_base="1.3", config_path=str(config_folder()), config_name=config_name)
        @functools.wraps(run)
        def main(cfg: DictConfig) -> Any:
            return _guarded(run, cfg)

        entry: Callable[[], Any] = main
        return entry

    return decorate


def _guarded(run: Run, cfg: DictConfig) -> Any:
    sweeping = HydraConfig.get().mode == RunMode.MULTIRUN
    try:
        result = run(cfg)
    except Exception as raised:
        error = _own_error(raised)
        record = {"status": "failed", "error": str(error), "kind": type(error).__name__}
        write_json(output_folder() / "result.json", record)
        mendable = isinstance(error, CsmError)
        if cfg.get("debug") or not mendable:
            traceback.print_exc()
        if not sweeping and not mendable:
            sys.exit(1)
        print(f"csm: {error}", file=sys.stderr)
        if not sweeping:
            sys.exit(2)
        return None
    write_json(output_folder() / "result.json", {"status": "ok", **result})
    return result.get("objective")


def _own_error(error: Exception) -> Exception:
    """Return the error that Hydra wrapped while it made an object, if it is one of csm's."""
    return error.__cause__ if isinstance(error.__cause__, CsmError) else error


def make_datamodule(cfg: DictConfig) -> CorrespondenceDataModule:
    """Make the data module of the data group, with the descriptor of its group, the model's stencils and the store."""
    network: dict[str, Any] = OmegaConf.to_container(cfg.model, resolve=True)  # type: ignore[assignment]
    datamodule: CorrespondenceDataModule = instantiate(cfg.data, _partial_=True)(
        descriptor=instantiate(cfg.descriptor),
        stencils=stencils_for(network),
        store=Store(cfg.store),
        workers=cfg.workers,
    )
    return datamodule
