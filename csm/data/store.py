"""A content-addressed store of everything that is computed once per shape.

One entry is one ``.npz`` file without pickle.  Its name is the hash of what it depends on: the geometry, the kind,
every parameter, the version of a formula that was changed, and the number of the file format.  Another parameter makes
another entry, so an outdated one is never returned.  The file contains its own description.  Entries are written under
a temporary name and renamed, so several processes may share a store: two that compute the same entry at once lose a
little time and nothing else.
"""

from __future__ import annotations

import logging
import os
import secrets
import stat
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import platformdirs

from csm._types import Arrays
from csm.data.entries import (
    ENTRY_NAME,
    KINDS,
    TEMPORARY_NAME,
    Entry,
    EntryError,
    Fault,
    entry_name,
    is_entry,
    read_entry,
    write_entry,
)
from csm.mesh.shape import Mesh

_log = logging.getLogger(__name__)
_unwritable: set[Path] = set()
"""Stores that cannot be written, which has been said once."""


class Store:
    """Arrays on disk, addressed by what they were computed from.

    Parameters
    ----------
    root
        Folder of the store, made when first written to.  By default the environment variable `CSM_CACHE`, else the
        user's cache folder of the operating system.

    Attributes
    ----------
    computed
        How many entries this object had to compute.
    """

    def __init__(self, root: str | os.PathLike[str] | None = None) -> None:
        self.root = Path(root or os.environ.get("CSM_CACHE") or platformdirs.user_cache_dir("csm")).expanduser()
        self.computed = 0

    def __repr__(self) -> str:
        return f"Store({str(self.root)!r})"

    def path(self, kind: str, mesh: Mesh, params: Mapping[str, Any]) -> Path:
        """Return the file that holds, or would hold, this entry."""
        return self.root / kind / entry_name(kind, mesh.digest, params)

    def has(self, kind: str, mesh: Mesh, params: Mapping[str, Any]) -> bool:
        """Tell whether the entry exists and is described as such; faults in its arrays are found when it is read."""
        path = self.path(kind, mesh, params)
        return os.path.isfile(path) and is_entry(path)

    def fetch(self, kind: str, mesh: Mesh, params: Mapping[str, Any], make: Callable[[], Arrays]) -> Arrays:
        """Return the entry's arrays; if there is no entry yet, compute them with `make` and keep them.

        A file that is corrupt, holds another entry, or was written by another program, is reported and replaced by a
        new entry.  Where the store cannot be written, that is said once, and nothing is kept.

        Parameters
        ----------
        kind
            A short name such as "lbo" or "descriptor"; it becomes a sub-folder.
        mesh
            The geometry that the arrays belong to.
        params
            Every parameter that the arrays depend on, as plain data.
        make
            Called without arguments when the entry has to be computed.
        """
        found = self.read(kind, mesh, params)
        if found is not None:
            return found
        arrays = make()
        self.computed += 1
        self._keep(kind, mesh, params, arrays)
        return arrays

    def read(self, kind: str, mesh: Mesh, params: Mapping[str, Any]) -> Arrays | None:
        """Return the entry's arrays if it exists and is sound, else None; parameters as of `fetch`."""
        path = self.path(kind, mesh, params)
        if not os.path.lexists(path):
            return None
        try:
            return read_entry(path)[1]
        except EntryError as error:
            _log.warning("%s; computing it again", error)
        return None

    def why_not_writable(self) -> str | None:
        """Return None if entries can be written, else a sentence; a small file is written and deleted to find out."""
        probe = self.root / f".probe.{secrets.token_hex(4)}.tmp"
        try:
            self.root.mkdir(parents=True, exist_ok=True)
            probe.write_bytes(bytes(1024))
            probe.unlink()
        except OSError as error:
            return _sentence(self.root, error)
        return None

    def _keep(self, kind: str, mesh: Mesh, params: Mapping[str, Any], arrays: Arrays) -> None:
        path = self.path(kind, mesh, params)
        try:
            try:
                write_entry(path, kind, mesh, params, arrays)
            except FileNotFoundError:  # the folder was removed while the file was written: it is made again
                write_entry(path, kind, mesh, params, arrays)
        except OSError as error:
            self._warn_once(error)

    def _warn_once(self, error: OSError) -> None:
        if self.root not in _unwritable:
            _unwritable.add(self.root)
            _log.warning("%s; what is computed is used, but not kept", _sentence(self.root, error))

    def files(self) -> list[Path]:
        """Return the files with the name of an entry, sound or not, in a fixed order; other files are not csm's."""
        return sorted(path for path in self.root.glob("*/*.npz") if ENTRY_NAME.fullmatch(path.name))

    def check(self) -> tuple[list[Entry], list[str]]:
        """Read every file completely; return the sound entries and one sentence per faulty file."""
        sound: list[Entry] = []
        faults: list[str] = []
        for path in self.files():
            try:
                sound.append(read_entry(path)[0])
            except EntryError as error:
                faults.append(str(error))
        return sound, faults

    def prune(self, *, unused_days: float | None = None) -> list[Path]:
        """Delete what cannot be used: damaged and swapped files, other schemas, temporary files older than an hour.

        Files without the name of an entry are never touched, nor is a file with such a name that is sound but no entry,
        or that cannot be read in a folder that no kind of entry has: another program may have written it.

        Parameters
        ----------
        unused_days
            Also delete sound entries that nobody has read for this many days.

        Returns
        -------
        list of Path
            What was deleted.
        """
        temporary = [path for path in self.root.glob("*/.*tmp.npz") if _is_left_over(path)]
        waste = [path for path in self.files() if _is_waste(path, unused_days)]
        return [path for path in [*temporary, *waste] if _deleted(path)]


def _sentence(root: Path, error: OSError) -> str:
    why = error.strerror or str(error)
    return f"{root}: the store cannot be written ({why}); make room or set CSM_CACHE to a folder of your own"


def _idle_seconds(path: Path) -> float:
    """Return for how long a file was not used; 0 if it is gone, or no file."""
    try:
        status = path.stat()
    except OSError:
        return 0.0
    return time.time() - max(status.st_atime, status.st_mtime) if stat.S_ISREG(status.st_mode) else 0.0


def _is_left_over(path: Path) -> bool:
    ours = TEMPORARY_NAME.fullmatch(path.name) and KINDS.fullmatch(path.parent.name)
    return bool(ours) and _idle_seconds(path) > 3600


def _is_waste(path: Path, unused_days: float | None) -> bool:
    idle = _idle_seconds(path)  # before it is read
    try:
        read_entry(path)
    except EntryError as error:
        known = KINDS.fullmatch(path.parent.name) is not None
        return error.fault is Fault.UNUSABLE or (error.fault is Fault.DAMAGED and known)
    return unused_days is not None and idle > unused_days * 86400


def _deleted(path: Path) -> bool:
    try:
        path.unlink()
    except FileNotFoundError:
        return False
    except OSError as error:
        _log.warning("%s: cannot be deleted (%s)", path, error.strerror)
        return False
    return True
