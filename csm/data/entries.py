"""One file of a store: an entry with its description, written whole and believed only after it has been checked."""

from __future__ import annotations

import errno
import hashlib
import io
import json
import re
import stat
import time
import zipfile
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from enum import Enum
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from csm import __version__
from csm._types import Arrays
from csm.errors import DataError
from csm.mesh.io import atomic_path
from csm.mesh.shape import Mesh

SCHEMA = 1
"""Number of the file format; entries of another format are recomputed.

Where a formula changes, the `version` of its descriptor or stencil is raised instead, which changes the keys of its own
entries and of no others.
"""

KINDS = re.compile(
    r"lbo|albo|descriptor|stencil-.+|matched|remesh|geodesic-(row|diameter)|network-cost|descriptor-time"
)
"""The kinds that csm writes, which are the names of the folders; only in these a damaged file is surely csm's."""

ENTRY_NAME = re.compile(r"[0-9a-f]{40}\.npz")
TEMPORARY_NAME = re.compile(r"\.[0-9a-f]{40}\..*tmp\.npz")
"""What `csm.mesh.io.atomic_path` makes of the name of an entry."""

_META = "__meta__"
_NOT_ITS_FAULT = {errno.ENOENT, errno.EACCES, errno.EPERM, errno.EIO, errno.ENOMEM, errno.EMFILE, errno.ENFILE}
_TEXTS = ("kind", "shape", "geometry", "created")


class Fault(Enum):
    """What is wrong with a file of a store, which decides who may delete it."""

    FOREIGN = "sound, but not an entry"
    UNREADABLE = "not to be read now"
    DAMAGED = "cut or altered, so that it is not sure whose it was"
    UNUSABLE = "written by csm, but not to be used"


class EntryError(DataError):
    """A file of a store cannot be used as an entry."""

    def __init__(self, message: str, fault: Fault) -> None:
        super().__init__(message)
        self.fault = fault


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


def entry_name(kind: str, geometry: str, params: Mapping[str, Any]) -> str:
    """Return the name of the file of an entry: a hash of all that it depends on."""
    request = json.dumps({"schema": SCHEMA, "kind": kind, "geometry": geometry, "params": dict(params)}, sort_keys=True)
    return f"{hashlib.sha256(request.encode()).hexdigest()[:40]}.npz"


def write_entry(path: Path, kind: str, mesh: Mesh, params: Mapping[str, Any], arrays: Arrays) -> None:
    """Write one entry under a temporary name and rename it; OSError if that cannot be done."""
    meta = {
        "schema": SCHEMA,
        "kind": kind,
        "shape": mesh.name,
        "geometry": mesh.digest,
        "params": dict(params),
        "created": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        "versions": _versions(),
        "checksum": checksum(arrays),
    }
    header = np.frombuffer(json.dumps(meta).encode(), dtype=np.uint8)
    if path.is_symlink() or path.is_fifo() or path.is_socket():
        path.unlink()  # what a link points to is not csm's to be overwritten; a pipe cannot be written
    try:
        with atomic_path(path) as temporary, temporary.open("wb") as file:
            np.savez(file, allow_pickle=False, **{_META: header}, **arrays)
    except DataError as error:
        why = error.__cause__
        raise (why if isinstance(why, OSError) else OSError(errno.EEXIST, str(error), str(path))) from None


def read_entry(path: Path) -> tuple[Entry, Arrays]:
    """Read one file of a store completely and check it: its own checksums, and that its content is what its name says.

    Raises
    ------
    EntryError
        If the file is cut, altered, of another schema, the entry of another name, or not an entry of a store.
    """
    with _Opened(path) as opened:
        meta = opened.meta()
        arrays = {name: opened.array(name) for name in opened.names if name != _META}
        if "checksum" in meta and meta["checksum"] != checksum(arrays):  # older entries have none
            why = "its arrays are not those that were written (their checksum differs)"
            raise EntryError(f"{path}: {why}", Fault.UNUSABLE)
        return opened.entry(meta), arrays


def is_entry(path: Path) -> bool:
    """Tell whether a file is an entry with the content that its name says; its arrays are not read."""
    try:
        with _Opened(path) as opened:
            opened.meta()
    except EntryError:
        return False
    return True


def checksum(arrays: Arrays) -> str:
    """Return a hash of names, types, shapes and values of arrays, in the order of their names."""
    digest = hashlib.blake2b(digest_size=16)
    for name, values in sorted(arrays.items()):
        array = np.asarray(values)
        digest.update(json.dumps([name, array.dtype.str, array.shape]).encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


class _Opened:
    """An open file of a store; whatever goes wrong while it is read is an EntryError that names the file."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __enter__(self) -> _Opened:
        try:
            status = self.path.stat()
            regular = stat.S_ISREG(status.st_mode)
            opened = zipfile.ZipFile(self.path) if regular else None  # opening a pipe would wait for ever
        except Exception as error:
            raise self._named(error) from error
        if opened is None:
            raise EntryError(f"{self.path}: this is no file, so not an entry of a csm store", Fault.FOREIGN)
        self._zip, self.bytes = opened, status.st_size
        self.names = [name.removesuffix(".npy") for name in self._zip.namelist()]
        return self

    def __exit__(self, _kind: object, error: BaseException | None, _trace: object) -> None:
        with suppress(Exception):
            self._zip.close()
        if isinstance(error, Exception) and not isinstance(error, EntryError):
            raise self._named(error) from error

    def meta(self) -> dict[str, Any]:
        """Return the description, checked against the name of the file."""
        if _META not in self.names:
            raise EntryError(f"{self.path}: not an entry of a csm store (it has no {_META})", Fault.FOREIGN)
        meta: dict[str, Any] = json.loads(bytes(self.array(_META)))
        if meta["schema"] != SCHEMA:
            fault = Fault.UNUSABLE if "geometry" in meta and "kind" in meta else Fault.DAMAGED
            known = f"this version of csm writes schema {SCHEMA}"
            raise EntryError(f"{self.path}: of schema {meta['schema']}, {known}", fault)
        if not all(isinstance(meta[key], str) for key in _TEXTS) or not isinstance(meta["params"], dict):
            raise TypeError("its description is not of the types that csm writes")
        where = meta["kind"], entry_name(meta["kind"], meta["geometry"], meta["params"])
        if where != (self.path.parent.name, self.path.name):
            what = f"holds another entry than its name says, {meta['kind']} of {meta['shape']}"
            raise EntryError(f"{self.path}: {what}; were files swapped or restored?", Fault.UNUSABLE)
        return meta

    def entry(self, meta: Mapping[str, Any]) -> Entry:
        """Return what the description says."""
        kind, shape, params = meta["kind"], meta["shape"], meta["params"]
        return Entry(self.path, kind, shape, params, meta["schema"], meta["created"], self.bytes)

    def array(self, name: str) -> NDArray[Any]:
        """Return one array; sizes are compared with the file's before memory is taken."""
        info = self._zip.getinfo(f"{name}.npy")
        if info.compress_type != zipfile.ZIP_STORED or info.file_size > self.bytes:
            raise ValueError(f"its part {name} is packed in another way or larger than the file")
        content = io.BytesIO(self._zip.read(info))
        size = _announced(content)
        if size != info.file_size:
            raise ValueError(f"its part {name} announces {size} bytes, but has {info.file_size}")
        content.seek(0)
        found: NDArray[Any] = np.lib.format.read_array(content, allow_pickle=False)
        return found

    def _named(self, error: Exception) -> EntryError:
        why = f"it lacks {error}" if isinstance(error, KeyError) else str(error) or type(error).__name__
        if isinstance(error, MemoryError) or getattr(error, "errno", None) in _NOT_ITS_FAULT:
            return EntryError(f"{self.path}: cannot be read ({getattr(error, 'strerror', why)})", Fault.UNREADABLE)
        return EntryError(f"{self.path}: corrupt or not an entry of a csm store ({why})", Fault.DAMAGED)


def _announced(content: io.BytesIO) -> int:
    """Return how many bytes the header of an array says that it has, with the header."""
    major, _ = np.lib.format.read_magic(content)
    read = np.lib.format.read_array_header_1_0 if major == 1 else np.lib.format.read_array_header_2_0
    shape, _, dtype = read(content)
    count = 1
    for n in shape:
        count *= int(n)
    return content.tell() + count * dtype.itemsize


@cache
def _versions() -> dict[str, str]:
    """Return the versions of what entries are computed with; asking the installation takes 5 ms each."""
    return {"csm": __version__, **{name: version(name) for name in ("numpy", "scipy")}}
