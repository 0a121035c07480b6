"""One guard for everything that a stranger's file can do: what may be opened, how much is read, what errors become."""

from __future__ import annotations

import os
import stat
import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from csm.errors import ConfigError, CsmError, DataError, MeshError

LARGEST_FILE = 8 << 30
"""Bytes; a larger file is refused before it is opened."""

LARGEST_UNPACKED = 2 << 30
"""Bytes; what a compressed file may become in memory."""

_KINDS = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a named pipe"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
    (stat.S_ISSOCK, "a socket"),
)


@contextmanager
def refusals(path: str | os.PathLike[str], doing: str = "read") -> Iterator[None]:
    """Turn what the system says of a path into a `DataError` that names it as it was given."""
    try:
        yield
    except MemoryError:
        raise DataError(f"{path}: cannot be {doing}: there is not enough memory") from None
    except OSError as error:
        if doing == "read" and isinstance(error, FileNotFoundError):
            raise DataError(f"{path}: there is no such file") from None
        raise DataError(f"{path}: cannot be {doing} ({error.strerror or error})") from error
    except ValueError as error:  # a name with a zero byte
        raise DataError(f"{str(path)!r}: cannot be {doing} ({error})") from error


def require_path_and(path: object, thing: object, kind: type, call: str) -> None:
    """Raise a ConfigError unless a writer is given a path and what it writes, in this order."""
    if isinstance(path, str | os.PathLike) and isinstance(thing, kind):
        return
    swapped = isinstance(thing, str | os.PathLike) and isinstance(path, kind)
    raise ConfigError(
        f"{call} got a {type(path).__name__} and a {type(thing).__name__}"
        f"{', the other way round' if swapped else ''}; wanted the path first and then a csm {kind.__name__}, as in "
        f"{call}('out.obj', {kind.__name__.lower()})"
    )


def require_regular(path: str | os.PathLike[str]) -> int:
    """Return the size in bytes of a regular file, also behind links, without opening it.

    Raises
    ------
    DataError
        If there is none, or it is a folder, pipe, device or socket (reading these may never end), or it is larger
        than `LARGEST_FILE`.
    """
    with refusals(path):
        status = os.stat(path)
    for is_kind, kind in _KINDS:
        if is_kind(status.st_mode):
            raise DataError(f"{path}: this is {kind}, wanted a file")
    if status.st_size > LARGEST_FILE:
        raise DataError(f"{path}: the file has {status.st_size >> 20} MiB; csm reads up to {LARGEST_FILE >> 20} MiB")
    return status.st_size


@contextmanager
def parsing(path: str, wanted: str) -> Iterator[None]:
    """Name the file in the errors of a parser, and make one of whatever a damaged file lets a library raise.

    NaN and infinities that a file holds are no fault of the arithmetic with them, so NumPy does not warn of these.
    """
    try:
        with np.errstate(all="ignore"):
            yield
    except CsmError as error:
        raise MeshError(f"{path}: {_printable(str(error).removeprefix(f'{path}: '))}") from error.__cause__
    except MemoryError:
        raise MeshError(f"{path}: this needs more memory than there is; the file may be damaged") from None
    except Exception as error:
        why = _printable(str(error))[:200] or type(error).__name__
        raise MeshError(f"{path}: this is no {wanted} file, or it is damaged or cut short ({why})") from error


def _printable(text: str) -> str:
    """Return a message in one line; what a file holds may not move the cursor or colour the terminal."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())


def most_unpacked(packed: int) -> int:
    """Return how many bytes a compressed mesh of `packed` bytes may become.

    Meshes are packed to a third or so; what becomes a hundred times larger is no mesh but made to fill the memory.
    """
    return min(LARGEST_UNPACKED, (32 << 20) + 100 * packed)


def inflate(data: bytes, wbits: int = 31, limit: int = LARGEST_UNPACKED) -> tuple[bytes, int]:
    """Decompress deflated data without ever holding more than `limit` bytes of the result.

    Parameters
    ----------
    data
        One stream, or with `wbits` 31 (gzip) any number of them one after the other.
    wbits
        As of `zlib.decompressobj`: 31 for gzip, 15 for zlib.
    limit
        Bytes.

    Returns
    -------
    The result, and how many bytes of `data` were left over.

    Raises
    ------
    MeshError
        If the stream is damaged, cut short or becomes larger than `limit`.
    """
    parts: list[bytes] = []
    total = 0
    while True:
        stream = zlib.decompressobj(wbits)
        try:
            parts.append(stream.decompress(data, limit - total + 1))
        except (zlib.error, struct.error) as error:
            raise MeshError(f"the compressed data is damaged ({error})") from None
        total += len(parts[-1])
        if total > limit:
            raise MeshError(f"the compressed data becomes larger than {limit >> 20} MiB, which is refused")
        if not stream.eof:
            raise MeshError("the compressed data is cut short")
        data = stream.unused_data
        if wbits != 31 or not data.startswith(b"\x1f\x8b"):
            return parts[0] if len(parts) == 1 else b"".join(parts), len(data)
