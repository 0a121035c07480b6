"""Unpacking of .zip and .tar archives, with limits on what a stranger's archive may do to the disk."""

from __future__ import annotations

import os
import shutil
import stat
import tarfile
import tempfile
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath

from csm.errors import DataError
from csm.mesh.io.guard import refusals

LARGEST_ARCHIVE = 256 << 30
"""Bytes that an archive may unpack to, however much room there is."""

_METHODS = {zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA}


def unpack(archive: Path, folder: Path) -> None:
    """Unpack a .tar (also .xz, .gz, .bz2) or .zip archive into `folder`.

    Raises
    ------
    DataError
        If the file is no such archive, is cut short, encrypted or compressed in a way that Python does not know, would
        become larger than the disk has room for, or holds links, devices or entries that point outside.
    """
    _require_file(archive)
    folder.mkdir(parents=True, exist_ok=True)
    try:
        if zipfile.is_zipfile(archive):
            _unpack_zip(archive, folder)
        else:
            _unpack_tar(archive, folder)
    except DataError:
        raise
    except MemoryError:
        raise DataError(f"{archive}: cannot be unpacked: there is not enough memory; is it damaged?") from None
    except Exception as error:  # the libraries raise whatever a damaged archive lets them trip over
        why = str(error).partition("\n")[0].removesuffix(":") or type(error).__name__
        raise DataError(f"{archive}: cannot be unpacked ({why}); wanted a whole .zip or .tar archive") from error


def _require_file(archive: Path) -> None:
    with refusals(archive):
        mode = os.stat(archive).st_mode
        if not stat.S_ISREG(mode):
            raise DataError(f"{archive}: this is {'a folder' if stat.S_ISDIR(mode) else 'no file'}, wanted an archive")
        with archive.open("rb"):
            pass


def _unpack_zip(archive: Path, folder: Path) -> None:
    with zipfile.ZipFile(archive) as opened:
        members = opened.infolist()
        for member in members:
            _require_inside(archive, member.filename)
            if stat.S_ISLNK(member.external_attr >> 16):
                raise DataError(f"{archive}: its member {member.filename} is a link, which csm does not unpack")
            if member.flag_bits & 1:
                raise DataError(f"{archive}: its member {member.filename} is encrypted; unpack it yourself first")
            if member.compress_type not in _METHODS:
                raise DataError(
                    f"{archive}: its member {member.filename} is compressed with method {member.compress_type}, which "
                    "Python does not know; unpack it with another program first"
                )
        _require_room(archive, folder, sum(member.file_size for member in members))
        for member in members:
            opened.extract(member, folder)


def _unpack_tar(archive: Path, folder: Path) -> None:
    total = 0
    with tarfile.open(archive) as opened:
        for member in opened:
            _require_inside(archive, member.name)
            if not (member.isfile() or member.isdir()):
                kind = "a link" if member.issym() or member.islnk() else "no file but a device or a pipe"
                raise DataError(f"{archive}: its member {member.name} is {kind}, which csm does not unpack")
            _require_room(archive, folder, member.size, total)
            total += member.size
            opened.extract(member, folder, filter="data")


def _require_inside(archive: Path, name: str) -> None:
    path = PurePosixPath(name.replace("\\", "/"))
    if path.is_absolute() or ".." in path.parts or (path.parts and path.parts[0].endswith(":")):
        raise DataError(f"{archive}: cannot be unpacked: its member {name} points outside of the archive")


def _require_room(archive: Path, folder: Path, size: int, before: int = 0) -> None:
    free = shutil.disk_usage(folder).free
    if size > free:
        raise DataError(f"{archive}: unpacks to {size >> 20} MiB more, but {folder} has {free >> 20} MiB left")
    if size + before > LARGEST_ARCHIVE:
        raise DataError(f"{archive}: unpacks to more than {LARGEST_ARCHIVE >> 30} GiB, which is refused")


@contextmanager
def unpacked(source: Path) -> Iterator[Path]:
    """Give a folder with the content of `source`: itself if it is a folder, else a temporary one, removed at the end.

    Raises
    ------
    DataError
        If `source` does not exist or is an archive that cannot be unpacked.
    """
    if source.is_dir():
        yield source
        return
    with tempfile.TemporaryDirectory(prefix="csm-") as folder:
        unpack(source, Path(folder))
        yield Path(folder)
