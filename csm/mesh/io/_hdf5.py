"""A program that reads the numbers in an HDF5 file, as MATLAB arranges them, from its input and writes them out.

Structs are groups, cells and arrays of structs are data sets of references, and arrays lie transposed.  Nothing outside
of the file is opened, and no size is believed.  It is a program so that `csm.mesh.io.matlab73` can give it limits; it
needs h5py and NumPy alone, so that it starts quickly.
"""

from __future__ import annotations

import os
import sys

if sys.path and os.path.realpath(sys.path[0]) == os.path.dirname(os.path.realpath(__file__)):
    del sys.path[0]  # the modules beside this one are no libraries

import io
import json
import math
import signal
from typing import Any, BinaryIO

import h5py
import numpy as np

_LARGEST = 2 << 30
"""Bytes that one file may unpack to."""
_DEEPEST = 50
_MOST_OBJECTS = 100_000
_INFLATION = 1100
"""Deflate packs at best 1032 bytes into one."""


class Refused(Exception):  # noqa: N818
    """Why a file is not read."""


class Tree:
    """Reads a file object by object, each of them once, however often it is linked to."""

    def __init__(self, file: h5py.File) -> None:
        self.file = file
        self.seen: dict[int, Any] = {}
        self.left = _LARGEST

    def read(self) -> dict[str, Any]:
        """Return the variables by name: arrays as MATLAB has them, dictionaries, lists, and None for the rest."""
        variables: dict[str, Any] = self._group(self.file, 0)
        return variables

    def _value(self, item: Any, depth: int) -> Any:
        if depth > _DEEPEST:
            raise Refused(f"its structs or cells are nested more than {_DEEPEST} times: it is damaged")
        address = h5py.h5o.get_info(item.id).addr
        if address in self.seen:
            return self.seen[address]  # an array for another name of it, None for a group
        if len(self.seen) > _MOST_OBJECTS:
            raise Refused(f"it holds more than {_MOST_OBJECTS} objects, which no mesh has: it is damaged")
        self.seen[address] = None
        if isinstance(item, h5py.Group):
            return self._group(item, depth)
        if isinstance(item, h5py.Dataset):
            value = self._dataset(item, depth)
            self.seen[address] = value if isinstance(value, np.ndarray) else None
            return value
        return None

    def _group(self, group: h5py.Group, depth: int) -> Any:
        fields: dict[str, Any] = {}
        references = 0
        for key in group:
            if key.startswith("#"):
                continue
            item = self._linked(group, key)
            if item is None:
                continue
            fields[key] = self._value(item, depth + 1)
            references += isinstance(fields[key], list) and _matlab_class(item) == ""
        lengths = {len(value) for value in fields.values() if isinstance(value, list)}
        if depth and fields and references == len(fields) and len(lengths) == 1:  # an array of structs
            return [{key: value[i] for key, value in fields.items()} for i in range(lengths.pop())]
        return fields

    def _linked(self, group: h5py.Group, key: str, hops: int = 0) -> Any:
        """Return what a link leads to inside of this file, None if it leads nowhere."""
        link = group.get(key, getlink=True)
        if isinstance(link, h5py.HardLink):
            return group[key]
        if not isinstance(link, h5py.SoftLink):
            raise Refused("it has an external link, to another file of this computer, which csm does not follow")
        if hops > 8:
            return None
        here: Any = self.file if link.path.startswith("/") else group
        for part in filter(None, link.path.split("/")):
            if part == ".":
                continue
            if not isinstance(here, h5py.Group) or here.get(part, getlink=True, default=None) is None:
                return None
            here = self._linked(here, part, hops + 1)
        return here

    def _dataset(self, item: h5py.Dataset, depth: int) -> Any:
        if item.external or item.is_virtual:
            raise Refused("it keeps an array in another file of this computer, which csm does not follow")
        kind = item.dtype.kind
        references = kind == "O" and h5py.check_ref_dtype(item.dtype) is h5py.Reference
        compound = kind == "V" and item.dtype.names == ("real", "imag")
        if item.shape is None or not (kind in "iufc" or references or compound) or _matlab_class(item) == "char":
            return None
        if item.attrs.get("MATLAB_empty"):
            return np.zeros((0, 0))
        self._require_room(item)
        if references:
            if item.size > _MOST_OBJECTS:
                raise Refused(f"a cell announces {item.size} values: it is damaged")
            return [self._value(self.file[r], depth + 1) if r else None for r in np.ravel(item[()])]
        array = np.asarray(item[()])
        if compound:
            array, pair = np.empty(array.shape, dtype=np.complex128), array
            array.real, array.imag = pair["real"], pair["imag"]
        return array.T

    def _require_room(self, item: h5py.Dataset) -> None:
        size = item.size * item.dtype.itemsize
        stored = item.id.get_storage_size()
        packed = item.chunks is not None
        if size > (_INFLATION * stored + 4096 if packed else stored):
            raise Refused(f"an array announces {size} bytes, but {stored} are stored: it is damaged")
        chunk = math.prod(item.chunks) * item.dtype.itemsize if packed else 0
        self.left -= size
        if self.left < 0 or chunk > 8 * size + (64 << 20):
            raise Refused(f"an array announces {max(size, chunk)} bytes, more than csm reads")


def _matlab_class(item: Any) -> str:
    value = item.attrs.get("MATLAB_class", b"")
    return value.decode("latin-1") if isinstance(value, bytes) else str(value)


def limit(size: int) -> None:
    """Give this process, once its libraries are loaded, a limit of memory and of processor time, where there are such.

    Parameters
    ----------
    size
        Bytes of the file; a larger one may take longer.
    """
    try:
        import resource
    except ImportError:  # Windows has neither; there the time limit of the caller remains
        return
    signal.setitimer(signal.ITIMER_PROF, 0.5 + size / (20 << 20))  # ends the process, also inside of the library
    try:
        with open("/proc/self/statm") as file:
            used = int(file.read().split()[0]) * resource.getpagesize()
    except OSError:
        return
    _lower(resource.RLIMIT_AS, used + (512 << 20) + 40 * size)
    _lower(resource.RLIMIT_CORE, 0)


def _lower(what: int, value: int) -> None:
    import resource

    hard = resource.getrlimit(what)[1]
    resource.setrlimit(what, (value if hard == resource.RLIM_INFINITY else min(value, hard), hard))


def packed(value: Any, blobs: list[bytes], at: list[int]) -> Any:
    """Return json's form of a value; the bytes of arrays go to `blobs`, and `at` counts them."""
    if value is None:
        return None
    if isinstance(value, dict):
        return {"struct": {key: packed(item, blobs, at) for key, item in value.items()}}
    if isinstance(value, list):
        return {"list": [packed(item, blobs, at) for item in value]}
    blobs.append(value.tobytes(order="F"))
    at[0] += len(blobs[-1])
    return {"dtype": value.dtype.str, "shape": value.shape, "at": at[0] - len(blobs[-1])}


def answer(data: bytes) -> tuple[dict[str, Any], list[bytes]]:
    """Return json's form of a file's variables with the bytes of their arrays, or why it is refused."""
    blobs: list[bytes] = []
    try:
        with h5py.File(io.BytesIO(data), "r") as file:
            return {"tree": packed(Tree(file).read(), blobs, [0])}, blobs
    except Refused as error:
        return {"refused": str(error)}, []
    except MemoryError:
        return {"refused": "it needs more memory than csm gives it: it is damaged"}, []
    except Exception as error:
        why = " ".join(str(error).split())[:200]
        return {"refused": f"this is no MATLAB v7.3 (HDF5) file or it is damaged ({why})"}, []


def main(source: BinaryIO, target: BinaryIO) -> None:
    """Read a file from `source` and write the answer to `target`: length of the json text, that text, the arrays."""
    data = source.read()
    limit(len(data))
    head, blobs = answer(data)
    text = json.dumps(head).encode()
    target.write(len(text).to_bytes(8, "little") + text)
    target.writelines(blobs)
    target.flush()


if __name__ == "__main__":
    main(sys.stdin.buffer, sys.stdout.buffer)
    os._exit(0)  # tearing down a library that has seen a damaged file can crash
