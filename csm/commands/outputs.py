"""Where a command may write: never over its own input, and over files that csm did not write only when told to."""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from hydra.core.hydra_config import HydraConfig
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import HydraException
from hydra.types import RunMode
from numpy.typing import NDArray

from csm.errors import ConfigError

OVERWRITE = "give another out=, or overwrite=true to replace it"
"""What can be done about a file that csm does not replace by itself."""

BEGINS_AGAIN = "the result is not written; the same command begins again (the store has what is known of the shapes)"
"""What is true of a stopped command that writes all of its result at its end, and keeps what it knows of shapes."""


def require_place(path: Path, what: str = "out") -> None:
    """Raise before the work if a folder cannot be made, or written into, at `path`; nothing is left there.

    Raises
    ------
    ConfigError
        If the name is too long, a part of the path is a file, or the folder may not be written.
    """
    try:
        path.lstat()
    except (FileNotFoundError, NotADirectoryError):
        pass
    except OSError as error:
        why = (error.strerror or "cannot be used").lower()
        raise ConfigError(f"{what}={path}: {why}; choose another place") from None
    above = next(place for place in (path, *path.absolute().parents) if os.path.lexists(place))
    if not above.is_dir():
        raise ConfigError(f"{what}={path}: {above} is a file, wanted a folder; choose another place")
    if not os.access(above, os.W_OK | os.X_OK):
        raise ConfigError(f"{what}={path}: the folder {above} may not be written; choose another place")
    try:  # permissions say nothing of file systems that are read-only or hold no files, such as /proc
        os.rmdir(tempfile.mkdtemp(prefix=".csm-", dir=above))
    except OSError as error:
        why = error.strerror or "the system refuses"
        raise ConfigError(
            f"{what}={path}: nothing can be written into the folder {above} ({why}); choose another place"
        ) from None


def require_file_place(path: Path, what: str = "out") -> None:
    """Raise before the work if a file cannot be written at `path`, see `require_place`."""
    if path.is_dir():
        raise ConfigError(f"{what}={path}: this is a folder, wanted the name of a file")
    if os.path.lexists(path):
        require_place(path.parent, what)
    else:
        require_place(path, what)


def require_results(results: str | None) -> None:
    """Raise before the work if result rows cannot be added to a file.

    Raises
    ------
    ConfigError, csm.errors.DataError
        If the place cannot be written, or the file that is there holds something else.
    """
    if results is None:
        return
    path = Path(results)
    require_file_place(path, "results")
    if path.exists():
        from csm.evaluation.report import read_rows

        read_rows(path)


def require_own_archive(path: Path, arrays: Iterable[str], overwrite: bool) -> None:
    """Raise if a .npz exists that does not have the arrays that this command writes.

    Raises
    ------
    ConfigError
        If so, and it may not be replaced.
    """
    if overwrite or not os.path.lexists(path):
        return
    try:
        own = path.is_file() and _is_own_archive(path, arrays)
    except Exception:
        own = False
    if not own:
        raise ConfigError(
            f"{path}: there is such a file, which was not written by csm describe, or changed since; {OVERWRITE}"
        )


def _is_own_archive(path: Path, arrays: Iterable[str]) -> bool:
    with np.load(path, allow_pickle=False) as archive:
        known = set(archive.files) - {"preset"}  # which archives of older versions lack
        return known == set(arrays) and str(archive["checksum"]) == checksum(archive["values"])


def checksum(values: NDArray[Any]) -> str:
    """Return the SHA-256 (hex) of an array."""
    return hashlib.sha256(np.ascontiguousarray(values).tobytes()).hexdigest()


_NAMED_BY = {
    "match": ("out", "source", "target", "folder"),
    "describe": ("out",),
    "clean": ("out",),
    "bodies": ("out",),
}
"""Commands that write to one place -> the keys that it depends on."""

_EACH_ITS_OWN = "the jobs of a sweep would replace each other's results; give each its own: out='NAME_${hydra:job.num}'"


def require_own_places(command: str, overrides: Sequence[str]) -> None:
    """Raise before the first job of a sweep if all of its jobs would write to the same place.

    Parameters
    ----------
    command
        Such as "match".
    overrides
        As Hydra takes them, flags among them.

    Raises
    ------
    ConfigError
        If so.
    """
    if command not in _NAMED_BY or not {"-m", "--multirun"} & set(overrides):
        return
    try:
        given = OverridesParser.create().parse_overrides([text for text in overrides if not text.startswith("-")])
    except HydraException:
        return  # Hydra itself says what is wrong with them
    swept = {one.key_or_group for one in given if one.is_sweep_override()}
    out = next((one for one in reversed(given) if one.key_or_group == "out"), None)
    value = None if out is None or out.is_sweep_override() else str(out.value())
    keys = _NAMED_BY[command] if value in (None, "None") else ("out",)
    if swept and not swept & set(keys) and "${" not in str(value):
        shown = "out" if value in (None, "None") else f"out={value}"
        raise ConfigError(f"{shown}: is the same for all jobs, and {_EACH_ITS_OWN}")


def require_new_in_sweep(out: Path) -> None:
    """Raise if a job of a sweep would write where another one has: an output that all jobs have in common."""
    if HydraConfig.initialized() and HydraConfig.get().mode == RunMode.MULTIRUN and os.path.lexists(out):
        raise ConfigError(f"out={out}: is there already, and {_EACH_ITS_OWN}")
