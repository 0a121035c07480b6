"""A content-addressed store of everything that is computed once per shape.

One entry is one ``.npz`` file without pickle.  Its name is the hash of what it depends on: the geometry, the kind,
every parameter, the version of a formula that was changed, and the number of the file format.  Another parameter makes
another entry, so an outdated one is never returned.  The file contains its own description.  Entries are written under
a temporary name and renamed, so several processes may share a store: two that compute the same entry at once lose a
little time and nothing else.
"""

from __future__ import annotations

import hashlib
import json
import logging
import os
import re
import time
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import platformdirs

from csm._types import Arrays
from csm.errors import DataError
from csm.mesh.io import atomic_path
from csm.mesh.shape import Mesh

SCHEMA = 1
"""Number of the file format; entries of another format are recomputed.

Where a formula changes, the `version` of its descriptor or stencil is raised instead, which changes the keys of its own
entries and of no others.
"""

_META = "__meta__"
_ENTRY_NAME = re.compile(r"[0-9a-f]{40}\.npz")
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Entry:
    """What one file of the store says of itself."""

    path: Path
    kind: str
    shape: str
    params: dict[str, Any]
    schema: int
    created: str
    bytes: int


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

    def path(self, kind: str, mesh: Mesh, params: Mapping[str, Any]) -> Path:
        """Return the file that holds, or would hold, this entry."""
        request = json.dumps(
            {"schema": SCHEMA, "kind": kind, "geometry": mesh.digest, "params": dict(params)}, sort_keys=True
        )
        return self.root / kind / f"{hashlib.sha256(request.encode()).hexdigest()[:40]}.npz"

    def has(self, kind: str, mesh: Mesh, params: Mapping[str, Any]) -> bool:
        """Tell whether the entry exists and its file is not cut off; other faults are found when it is read."""
        path = self.path(kind, mesh, params)
        return path.is_file() and zipfile.is_zipfile(path)

    def fetch(self, kind: str, mesh: Mesh, params: Mapping[str, Any], make: Callable[[], Arrays]) -> Arrays:
        """Return the entry's arrays; if there is no entry yet, compute them with `make` and keep them.

        A file that is corrupt, or that another program wrote, is reported and replaced by a new entry.

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
        self._write(self.path(kind, mesh, params), kind, mesh, params, arrays)
        return arrays

    def read(self, kind: str, mesh: Mesh, params: Mapping[str, Any]) -> Arrays | None:
        """Return the entry's arrays if it exists and is sound, else None; parameters as of `fetch`."""
        path = self.path(kind, mesh, params)
        if path.is_file():
            try:
                return read_entry(path)[1]
            except DataError as error:
                _log.warning("%s; computing it again", error)
        return None

    def _write(self, path: Path, kind: str, mesh: Mesh, params: Mapping[str, Any], arrays: Arrays) -> None:
        meta = {
            "schema": SCHEMA,
            "kind": kind,
            "shape": mesh.name,
            "geometry": mesh.digest,
            "params": dict(params),
            "created": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
            "versions": _versions(),
        }
        header = np.frombuffer(json.dumps(meta).encode(), dtype=np.uint8)
        with atomic_path(path) as temporary, temporary.open("wb") as file:
            np.savez(file, allow_pickle=False, **{_META: header}, **arrays)

    def files(self) -> list[Path]:
        """Return the files with the name of an entry, sound or not, in a fixed order; other files are not csm's."""
        return sorted(path for path in self.root.glob("*/*.npz") if _ENTRY_NAME.fullmatch(path.name))

    def check(self) -> tuple[list[Entry], list[str]]:
        """Read every file completely; return the sound entries and one sentence per faulty file."""
        sound: list[Entry] = []
        faults: list[str] = []
        for path in self.files():
            try:
                sound.append(read_entry(path)[0])
            except DataError as error:
                faults.append(str(error))
        return sound, faults

    def prune(self, *, unused_days: float | None = None) -> list[Path]:
        """Delete what cannot be used: faulty files, other schemas, and temporary files older than an hour.

        Files without the name of an entry are never touched.

        Parameters
        ----------
        unused_days
            Also delete sound entries that nobody has read for this many days.

        Returns
        -------
        list of Path
            What was deleted.
        """
        left_over = [path for path in self.root.glob("*/.*.tmp.npz") if _idle_seconds(path) > 3600]
        waste = [path for path in self.files() if _is_waste(path, unused_days)]
        for path in [*left_over, *waste]:
            path.unlink(missing_ok=True)
        return [*left_over, *waste]


@cache
def _versions() -> dict[str, str]:
    """Return the versions of what entries are computed with; asking the installation takes 5 ms each."""
    return {name: version(name) for name in ("csm", "numpy", "scipy")}


def _idle_seconds(path: Path) -> float:
    status = path.stat()
    return time.time() - max(status.st_atime, status.st_mtime)


def _is_waste(path: Path, unused_days: float | None) -> bool:
    idle = _idle_seconds(path)
    try:
        read_entry(path)
    except DataError:
        return True
    return unused_days is not None and idle > unused_days * 86400


def read_entry(path: Path) -> tuple[Entry, Arrays]:
    """Read one file of a store completely, verifying its checksums.

    Raises
    ------
    DataError
        If the file is cut, altered, of another schema, or not an entry of a store.
    """
    try:
        with np.load(path, allow_pickle=False) as archive:
            arrays = {key: archive[key] for key in archive.files}
    except (OSError, ValueError, EOFError, zipfile.BadZipFile, KeyError) as error:
        raise DataError(f"{path}: corrupt or not an entry of a csm store ({error})") from error
    if _META not in arrays:
        raise DataError(f"{path}: not an entry of a csm store (it has no {_META})")
    meta = json.loads(bytes(arrays.pop(_META)))
    if meta["schema"] != SCHEMA:
        raise DataError(f"{path}: of schema {meta['schema']}, this version of csm writes schema {SCHEMA}")
    entry = Entry(
        path, meta["kind"], meta["shape"], meta["params"], meta["schema"], meta["created"], path.stat().st_size
    )
    return entry, arrays
