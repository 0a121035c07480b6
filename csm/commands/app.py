"""What every command shares: how errors and signals reach the user, and what a job leaves behind."""

from __future__ import annotations

import functools
import hashlib
import json
import logging
import os
import shutil
import sys
import time
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import hydra
from hydra.core.hydra_config import HydraConfig
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from csm._signals import exit_status, terminable
from csm.commands.choices import config_folder
from csm.commands.explain import explained
from csm.commands.help import help_text
from csm.commands.outputs import require_own_places
from csm.commands.processes import end_with_parent, is_first, typed_command
from csm.commands.schema import require_valid
from csm.commands.words import asks_for_help, to_overrides
from csm.errors import ConfigError, CsmError
from csm.evaluation.provenance import remember_command
from csm.mesh.io import atomic_path

Run = Callable[[DictConfig], dict[str, Any] | None]

_NO_WORK = ("--cfg", "-c", "--info", "-i", "--hydra-help", "--version", "--shell-completion", "-sc")


_AT_ONCE = ("check", "clean", "describe", "doctor", "sweep-report")  # commands of which a stop leaves nothing


def output_folder() -> Path:
    """Return the folder of the running Hydra job."""
    return Path(HydraConfig.get().runtime.output_dir)


def write_json(path: Path, content: Any) -> None:
    """Write json under a temporary name, then rename it."""
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps(content, indent=1, allow_nan=True) + "\n")


def command(config_name: str, *, folder: bool = False, kept: Sequence[str] = ()) -> Callable[[Run], Callable[[], Any]]:
    """Turn ``run(cfg) -> dict of floats`` into a Hydra command; a process that only helps another one returns None.

    An error that the user can mend is printed as one paragraph and ends the process with status 2; with
    ``debug=true`` its traceback is shown.  Ctrl-C ends it with 130, SIGTERM with 143.  In a multirun a failing job is
    recorded and the sweep goes on.

    Parameters
    ----------
    config_name
        Name of its yaml, and of the command.
    folder
        Whether a job has a folder of its own, with ``result.json`` of what it returned.
    kept
        Files in that folder that a finished job leaves: a sweep that is started again in its folder does not do a job
        again whose settings are the same and whose files are there.
    """

    def decorate(run: Run) -> Callable[[], Any]:
        failures: list[Exception] = []

        @hydra.main(version_base="1.3", config_path=str(config_folder()), config_name=config_name)
        @functools.wraps(run)
        def main(cfg: DictConfig) -> Any:
            return _job(run, cfg, folder, failures, kept)

        def entry() -> Any:
            arguments = sys.argv[1:]
            if asks_for_help(arguments):
                print(help_text(config_name, arguments))
                return None
            if typed := typed_command():
                end_with_parent()
            remember_command(typed or sys.argv)
            with _errors_told(config_name, "debug=true" in arguments):
                sys.argv[1:] = to_overrides(config_name, arguments)
                require_own_places(config_name, sys.argv[1:])
                with terminable():
                    return _raising(failures, main, config_name, folder or _is_sweep(sys.argv))

        return entry

    return decorate


class _errors_told:  # noqa: N801 - reads as a phrase
    """Print what a user can mend as one paragraph, and end the process with the status that says how it ended."""

    def __init__(self, config_name: str, debug: bool) -> None:
        self._config_name, self._debug = config_name, debug

    def __enter__(self) -> None:
        os.environ["HYDRA_FULL_ERROR"] = "1"  # errors come here, instead of being printed by Hydra

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: Any) -> None:
        if error is None or isinstance(error, SystemExit | BrokenPipeError):
            return
        if self._debug:
            traceback.print_exception(error)
        if isinstance(error, KeyboardInterrupt):
            said = str(error) or _how_to_go_on(self._config_name)
            print(f"csm: stopped: {said}", file=sys.stderr)
            sys.exit(exit_status(error))
        text = explained(error, self._config_name)
        if text is None:
            if not self._debug:
                traceback.print_exception(error)
            print(
                f"csm: {type(error).__name__}: {error}\ncsm: this is a defect of csm; please report it", file=sys.stderr
            )
            sys.exit(1)
        print(f"csm: {text}", file=sys.stderr)
        sys.exit(2)


def _how_to_go_on(config_name: str) -> str:
    """Say how a command that was stopped is gone on with; the folder of a training is among its arguments by now."""
    folder = next((text for text in sys.argv if text.startswith("hydra.run.dir=")), "")
    if config_name == "train" and folder:
        return f"what was finished is kept; the same command with {folder} goes on from there"
    if config_name in _AT_ONCE and not _is_sweep(sys.argv):
        return "the result is not written; the same command begins again"
    return "what was finished is kept; the same command goes on from there or begins again"


def _raising(failures: list[Exception], main: Callable[[], Any], config_name: str, own_folder: bool) -> Any:
    """Run a command, and raise here what its job raised: raised through Hydra it would be announced twice."""

    def run() -> Any:
        failures.clear()
        result = main()
        if failures:
            raise failures[0]
        return result

    return _in_own_folder(run, config_name) if own_folder else run()


def _in_own_folder(main: Callable[[], Any], config_name: str) -> Any:
    """Run a command in a new folder under ``outputs/``, which is removed again if nothing but a failure is in it."""
    arguments = sys.argv[1:]
    sweeping = _is_sweep(arguments)
    key = "hydra.sweep.dir" if sweeping else "hydra.run.dir"
    if any(argument in _NO_WORK for argument in arguments):
        return main()
    given = next((argument.partition("=")[2] for argument in arguments if argument.startswith(f"{key}=")), None)
    if given is not None and "trainer=ddp" in arguments and not is_first():
        sys.argv += ["hydra.output_subdir=null", "hydra/job_logging=stdout"]  # the first process has the folder
        return main()
    if given is not None:
        return _in_given_folder(main, Path(given.strip("'\"")), config_name, sweeping)
    made = new_folder(Path("outputs") / (f"{config_name}_sweep" if sweeping else config_name))
    sys.argv.insert(1 + sweeping, f"{key}={made}")
    try:
        return main()
    except BaseException:
        _remove_if_bare(made)
        raise


def _in_given_folder(main: Callable[[], Any], folder: Path, config_name: str, sweeping: bool) -> Any:
    """Run a command in a folder of the user's choice: a new one, or that of an earlier run of the same command.

    What an earlier run says of itself stays if this one is refused.
    """
    if not folder.is_dir() or sweeping:
        try:
            return main()
        except BaseException:
            _remove_if_bare(folder)
            raise
    require_own_run(folder, config_name)
    kept = {
        path: path.read_bytes() for path in (*folder.glob(".hydra/*.yaml"), folder / "result.json") if path.is_file()
    }
    try:
        return main()
    except CsmError:
        for path, content in kept.items():
            path.write_bytes(content)
        raise


def require_own_run(folder: Path, config_name: str) -> None:
    """Raise a ConfigError if a folder holds files that no run of this command has left there."""
    held = sorted(path.name for path in folder.iterdir() if path.name != ".csm.lock")
    try:
        settings = OmegaConf.load(folder / ".hydra" / "hydra.yaml")
        own = str(OmegaConf.select(settings, "hydra.job.config_name")) == config_name
    except (OSError, ValueError, OmegaConfBaseException):
        own = False
    if held and not own:
        names = ", ".join(held[:3]) + (", ..." if len(held) > 3 else "")
        raise ConfigError(
            f"hydra.run.dir={folder}: this folder holds {names}, which no run of csm {config_name} has left there; "
            "choose a new folder"
        )


def _is_sweep(arguments: Sequence[str]) -> bool:
    return any(argument in ("-m", "--multirun") for argument in arguments)


def new_folder(above: Path) -> Path:
    """Make a folder named after the present second, with a number where another run was faster, and return it."""
    above.mkdir(parents=True, exist_ok=True)
    stamp = time.strftime("%Y-%m-%d_%H-%M-%S")
    for suffix in ("", *(f"_{n}" for n in range(2, 1000))):
        try:
            (above / f"{stamp}{suffix}").mkdir()
        except FileExistsError:
            continue
        return above / f"{stamp}{suffix}"
    raise CsmError(f"{above}: a thousand runs began in one second; try again")


def _remove_if_bare(folder: Path) -> None:
    """Remove the folder of a run that failed before it wrote anything; folders above go if they are empty."""
    bare = {".hydra", "result.json", ".csm.lock", "multirun.yaml"}
    if not folder.is_dir() or any(p.name not in bare and p.suffix != ".log" for p in folder.iterdir()):
        return
    for handler in list(logging.getLogger().handlers):
        if isinstance(handler, logging.FileHandler):  # its file is in the folder
            logging.getLogger().removeHandler(handler)
            handler.close()
    shutil.rmtree(folder, ignore_errors=True)
    for above in (folder.parent, folder.parent.parent):
        try:
            above.rmdir()
        except OSError:
            return


def _of_sweep(cfg: DictConfig, sweeping: bool) -> dict[str, Any]:
    """Return what the record of a job of a sweep has besides: its options, and a digest of all settings."""
    if not sweeping:
        return {}
    return {"overrides": [str(text) for text in HydraConfig.get().overrides.task], "settings": _settings(cfg)}


def _settings(cfg: DictConfig) -> str:
    """Return a digest of all settings of a job; empty if a reference among them leads nowhere."""
    try:
        text = OmegaConf.to_yaml(cfg, resolve=True, sort_keys=True)
    except OmegaConfBaseException:
        return ""
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _finished(cfg: DictConfig, kept: Sequence[str]) -> dict[str, Any] | None:
    """Return what a job of these settings left here, if an earlier run of the sweep has finished it."""
    here = output_folder()
    try:
        record: dict[str, Any] = json.loads((here / "result.json").read_text())
    except (OSError, ValueError):
        return None
    same = record.get("status") == "ok" and record.get("settings") == _settings(cfg)
    return record if kept and same and all((here / name).exists() for name in kept) else None


def _job(run: Run, cfg: DictConfig, folder: bool, failures: list[Exception], kept: Sequence[str] = ()) -> Any:
    """Run one job; a failure goes to `failures`, in a sweep it is kept in the job's folder and the others go on."""
    sweeping = HydraConfig.get().mode == RunMode.MULTIRUN
    if sweeping and (found := _finished(cfg, kept)) is not None:
        print(f"{output_folder()}: was finished by an earlier run of this sweep")
        return found.get("objective")
    try:
        require_valid(cfg)
        result = run(cfg)
    except Exception as error:
        text = explained(error, str(HydraConfig.get().job.config_name))
        if folder or sweeping:
            record = {"status": "failed", "error": text or str(error), "kind": type(error).__name__}
            write_json(output_folder() / "result.json", {**record, **_of_sweep(cfg, sweeping)})
        if not sweeping:
            failures.append(error)
            return None
        if text is None or cfg.get("debug"):
            traceback.print_exc()
        print(f"csm: {text or error}", file=sys.stderr)
        return None
    if result is None:
        return None
    if folder or sweeping:
        write_json(output_folder() / "result.json", {"status": "ok", **result, **_of_sweep(cfg, sweeping)})
    return result.get("objective")
