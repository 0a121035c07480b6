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
from omegaconf import DictConfig

from csm.errors import CsmError
from csm.mesh.io import atomic_path

Run = Callable[[DictConfig], dict[str, Any]]

_log = logging.getLogger(__name__)


def config_folder() -> Path:
    """Return the folder of the Hydra groups: inside the installed package, or beside it in a checkout."""
    package = Path(__file__).resolve().parent.parent
    inside = package / "conf"
    return inside if inside.is_dir() else package.parent / "conf"


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

        def entry() -> Any:
            sys.argv[1:] = in_order([without_null(argument) for argument in sys.argv[1:]])
            return main()

        return entry

    return decorate


def in_order(arguments: list[str]) -> list[str]:
    """Return ``-m`` first, wherever it stands: Hydra's parser wants all key=value in one piece.

    Examples
    --------
    >>> in_order(["experiment=humans", "-m", "seed=0,1"])
    ['-m', 'experiment=humans', 'seed=0,1']
    """
    flags = [argument for argument in arguments if argument in ("-m", "--multirun")]
    return flags + [argument for argument in arguments if argument not in flags]


def without_null(argument: str) -> str:
    """Return ``logger=none`` for ``logger=null``, which Hydra refuses for a group; other arguments stay.

    Examples
    --------
    >>> without_null("logger=null"), without_null("resume=null")
    ('logger=none', 'resume=null')
    """
    group, _, value = argument.partition("=")
    has_none = group.isidentifier() and (config_folder() / group / "none.yaml").is_file()
    return f"{group}=none" if has_none and value in ("null", "") and "=" in argument else argument


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
