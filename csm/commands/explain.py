"""One paragraph for every error that a user can mend: of csm, the operating system, Hydra, PyTorch and Lightning."""

from __future__ import annotations

import errno
import re
import zipfile
from collections.abc import Iterator, Mapping
from typing import Any

from hydra import compose, initialize_config_dir
from hydra.core.global_hydra import GlobalHydra
from hydra.errors import HydraException, InstantiationException, MissingConfigException
from omegaconf import OmegaConf
from omegaconf.errors import (
    InterpolationKeyError,
    InterpolationResolutionError,
    MissingMandatoryValue,
    OmegaConfBaseException,
)

from csm._extras import install_line
from csm.commands.choices import config_folder, options_of
from csm.commands.words import nearest_names
from csm.errors import CsmError, ParameterError
from csm.experiments._moved import MOVED

_EXTRAS = {
    "joblib": "sweep",
    "ray": "sweep",
    "submitit_local": "sweep",
    "submitit_slurm": "sweep",
    "optuna": "sweep",
    "polyscope": "viz",
    "anny": "prep",
}
"""What is missing -> the extra of csm that brings it."""

_FULL_KEY = re.compile(r"full_key: ([\w.]+)")

_ADVICE = {
    errno.ENOSPC: "the disk is full; free some space, or choose another folder",
    errno.EDQUOT: "your quota of disk space is used up; free some space, or choose another folder",
    errno.EACCES: "permission denied; choose a place that you may read and write",
    errno.EPERM: "permission denied; choose a place that you may read and write",
    errno.EROFS: "the file system is read-only; choose another place",
    errno.ENAMETOOLONG: "the name is too long for the file system; choose a shorter one",
    errno.ENOTDIR: "a file stands where a folder is wanted; choose another place",
    errno.EISDIR: "this is a folder, wanted a file",
    errno.EEXIST: "a file stands where a folder is wanted; choose another place",
    errno.ENOENT: "there is no such file or folder",
    errno.EMFILE: "too many files are open; use fewer workers, or raise the limit (ulimit -n)",
}


def explained(error: BaseException, config_name: str) -> str | None:
    """Return a paragraph for an error that the user can mend, or None for a defect of csm.

    Parameters
    ----------
    error
        What was raised.
    config_name
        The yaml of the command, whose keys are offered where one is misspelt.
    """
    for one in _chain(error):
        if isinstance(one, ParameterError):
            return _of_parameter(one, error)
        if isinstance(one, CsmError):
            return str(one)
    for one in _chain(error):
        text = _explained(one, config_name)
        if text:
            return text
    return None


def _chain(error: BaseException) -> Iterator[BaseException]:
    """Yield an error and what it was raised from, the outermost first."""
    seen: BaseException | None = error
    while seen is not None:
        yield seen
        seen = seen.__cause__ or (None if seen.__suppress_context__ else seen.__context__)


def _explained(error: BaseException, config_name: str) -> str | None:
    if isinstance(error, OSError) and error.errno is not None:
        return _of_the_system(error)
    if isinstance(error, MissingConfigException):
        return _missing_option(error)
    if isinstance(error, InstantiationException):
        return _not_made(error)
    if isinstance(error, HydraException | OmegaConfBaseException):
        return _of_hydra(error, config_name)
    if isinstance(error, ValueError) and "--resolve" in str(error):
        return "--resolve goes with --cfg: csm COMMAND --cfg job --resolve"
    if isinstance(error, ValueError) and "Config group override must be" in str(error):
        return "a group takes the name of one of its options, such as descriptor=acd; csm COMMAND --help lists them"
    if isinstance(error, ValueError) and "No trials are completed" in str(error):
        return "no job of the sweep ended with a number; their errors are above, and in result.json of every folder"
    if isinstance(error, ModuleNotFoundError) and (error.name or "") in _EXTRAS:
        return _extra(str(error.name))
    if isinstance(error, MemoryError):
        return f"there is not enough memory ({error}); use fewer workers, smaller meshes, or another descriptor"
    if isinstance(error, zipfile.BadZipFile):
        return f"an archive is damaged ({error})"
    return _of_torch(error) or _of_launchers(type(error).__name__, str(error))


def _of_the_system(error: OSError) -> str:
    place = ", ".join(str(name) for name in (error.filename, error.filename2) if name is not None)
    why = _ADVICE.get(error.errno or 0, error.strerror or str(error))
    return f"{place}: {why}" if place else f"{why} ({error})"


def _missing_option(error: MissingConfigException) -> str:
    missing = error.missing_cfg_file or ""
    group, _, name = missing.rpartition("/")
    if name in _EXTRAS and group.startswith("hydra"):
        return _extra(name, f"{group}={name}")
    options = options_of(group) if not group.startswith("hydra") else list(error.options or [])
    if not options:
        return f"there is no configuration {missing!r}; csm COMMAND --help lists the groups and their options"
    return f"{group}={name}: there is no such option{nearest_names(name, options)}; there are {', '.join(options)}"


def _extra(name: str, wanted: str = "") -> str:
    return f"{wanted or name} needs an extra that is not installed: {install_line(_EXTRAS[name])}"


def _of_parameter(error: ParameterError, outer: BaseException) -> str:
    """Say what is wrong with a parameter by the key that it is typed as, where its object was made from the options."""
    made = (str(one) for one in _chain(outer) if isinstance(one, InstantiationException))
    key = next((found[1] for found in map(_FULL_KEY.search, made) if found), None)
    if key is None:
        return str(error)
    value = "null" if error.value is None else list(error.value) if isinstance(error.value, tuple) else error.value
    return f"{key}.{error.name}={value}: wanted {error.wanted}"


def _not_made(error: InstantiationException) -> str | None:
    text = str(error.__cause__ or error)
    key = _FULL_KEY.search(str(error))
    where = f"{key[1]}: " if key else ""
    unknown = re.search(r"unexpected keyword argument '(\w+)'", str(error))
    if unknown:
        return f"{where}there is no option {unknown[1]!r}; --cfg job shows those that there are"
    if re.search(r"missing \d+ required", str(error)):
        return f"{where}{text.splitlines()[0]}"
    if re.search(r"Error locating target|Could not load|ModuleNotFound", str(error)):
        return f"{where}{str(error).splitlines()[0]}; _target_ wants the place of a class, such as csm.descriptors.ACD"
    return None


def _of_hydra(error: BaseException, config_name: str) -> str:
    text = str(error)
    if isinstance(error, MissingMandatoryValue):
        key = _FULL_KEY.search(text) or re.search(r"Missing mandatory value: ([\w.]+)", text)
        name = key[1] if key else "an option"
        return f"{name} has to be given: {name}=VALUE"
    if isinstance(error, InterpolationKeyError | InterpolationResolutionError):
        return f"a reference in the configuration leads nowhere: {text.splitlines()[0]}"
    key = re.search(r"Could not override '([^']+)'", text) or re.search(r"full_key: ([\w.]+)", text)
    if key:
        return _unknown_key(key[1], config_name)
    gone = re.search(r"Could not delete from config. '([^']+)'", text)
    if gone:
        return f"~{gone[1]}: there is no such key to leave out; --cfg job shows the configuration"
    if "Ambiguous value" in text:
        several = re.search(r"argument '([^']*)'", text)
        return f"{several[1] if several else 'a value'} is a list of values, which is for sweeps: add -m"
    parsed = re.search(r"Error parsing override '(.*)'", text) or re.search(r"at input '(.*)'", text)
    if parsed:
        return (
            f"{parsed[1]!r} is not of the form key=value that Hydra reads; values with = ( ) [ ] {{ }} ' , or # want "
            "quotes inside of the shell's: \"key='value'\""
        )
    return " ".join(text.split())


def _unknown_key(key: str, config_name: str) -> str:
    if key in MOVED:
        return f"{key} is now {MOVED[key]}"
    known = known_keys(config_name)
    if key in known:
        return f"{key} cannot be set or left out in this way; --help and --cfg job show what it may be"
    keys = [name for name in known if not name.rpartition(".")[2].startswith("_")]  # those are Hydra's own
    last = {name.rpartition(".")[2]: name for name in keys}
    near = nearest_names(key, keys)
    if not near and key.rpartition(".")[2] in last:
        near = f"; did you mean {last[key.rpartition('.')[2]]}?"
    near = near or nearest_names(key.rpartition(".")[2], last)
    if key.startswith("trainer."):
        near += f"; a setting of Lightning's Trainer that is not listed is added: +{key}=VALUE"
    return f"there is no option {key!r}{near}; --help lists the options, --cfg job the settings of what is chosen"


def known_keys(config_name: str) -> list[str]:
    """Return all keys of the configuration of a command as it is without options, nested ones with dots."""
    GlobalHydra.instance().clear()
    try:
        with initialize_config_dir(str(config_folder()), version_base="1.3"):
            return list(_flat(OmegaConf.to_container(compose(config_name), resolve=False)))
    except Exception:
        return []


def _flat(node: Any, above: str = "") -> Iterator[str]:
    if not isinstance(node, Mapping):
        return
    for key, value in node.items():
        name = f"{above}{key}"
        yield name
        yield from _flat(value, f"{name}.")


def _of_launchers(kind: str, text: str) -> str | None:
    """Explain errors of the libraries that run the jobs of a sweep."""
    if 'Could not detect "srun"' in text:
        return (
            "hydra/launcher=submitit_slurm: there is no Slurm on this machine (no srun); start the sweep where jobs "
            "are submitted, or take hydra/launcher=submitit_local, joblib or ray"
        )
    if "current node timed out during startup" in text:
        return (
            "hydra/launcher=ray: Ray did not start in time on this machine, which may be busy or short of memory; set "
            "RAY_raylet_start_wait_time_s=300 in the environment, or take hydra/launcher=joblib"
        )
    if kind in ("TerminatedWorkerError", "WorkerCrashedError", "UncompletedJobError"):
        return (
            "a process of the sweep was ended from outside, perhaps because memory ran out; what its jobs have "
            "finished is kept, and the same command with the same folder (hydra.sweep.dir) goes on from there"
        )
    return None


def _of_torch(error: BaseException) -> str | None:
    """Explain errors of PyTorch and Lightning, by their names: neither is imported by commands that do without."""
    kind, text = type(error).__name__, str(error)
    first = next((line.strip() for line in text.splitlines() if line.strip()), kind)
    if kind == "MisconfigurationException":
        return f"the trainer refuses its settings: {first}"
    if kind in ("OutOfMemoryError", "AcceleratorError") or "out of memory" in text:
        return f"the graphics card cannot do this: {first}; choose device=cpu and trainer=cpu, or smaller meshes"
    if re.search(r"Connection closed by peer|Connection reset by peer|gloo::|NCCL", text):
        return f"another process that trains together with this one has ended, and says above why ({first})"
    no_card = r"No CUDA GPUs|Found no NVIDIA driver|not compiled with CUDA"
    if isinstance(error, RuntimeError) and re.search(no_card, text):
        return f"there is no graphics card that PyTorch can use ({first}); choose device=cpu and trainer=cpu"
    return None
