"""Files and folders: atomic writing, natural order, unpacking of archives."""

from __future__ import annotations

import os
import re
import secrets
import shutil
import tarfile
import tempfile
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from csm.errors import DataError
from csm.mesh.io.guard import refusals, require_regular


def read_bytes(path: str | os.PathLike[str]) -> bytes:
    """Return the content of a file.

    Raises
    ------
    DataError
        If there is no such file, it may not be read, or it is something that does not end: a pipe or a device.
    """
    return _first_bytes(path, require_regular(path))


def read_bytes_of_head(path: str | os.PathLike[str], size: int = 1 << 16) -> bytes:
    """Return the first bytes of a file, with the same errors as `read_bytes`."""
    return _first_bytes(path, min(size, require_regular(path)))


def _first_bytes(path: str | os.PathLike[str], size: int) -> bytes:
    with refusals(path), Path(path).open("rb") as file:
        return file.read(size)


@contextmanager
def atomic_path(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Give a temporary name beside `path` to write to, and rename it to `path` when the block ends without an error.

    Readers see the old file or the whole new one, never a part.  Missing parent folders are made.  The temporary name
    is hidden, ends like `path` (writers look at the suffix) and is removed when the block raises.

    Examples
    --------
    >>> import tempfile
    >>> folder = Path(tempfile.mkdtemp())
    >>> with atomic_path(folder / "new" / "a.txt") as temporary:
    ...     _ = temporary.write_text("whole")
    >>> (folder / "new" / "a.txt").read_text()
    'whole'
    """
    final = Path(path)
    final.parent.mkdir(parents=True, exist_ok=True)
    temporary = final.with_name(f".{final.stem}.{secrets.token_hex(4)}.tmp{final.suffix}")
    try:
        yield temporary
        os.replace(temporary, final)
    finally:
        temporary.unlink(missing_ok=True)


def natural_key(name: str) -> tuple[tuple[int, int, str], ...]:
    """Return a sort key under which numbers count as numbers.

    Examples
    --------
    >>> sorted(["cat10", "cat9", "1", "10", "2"], key=natural_key)
    ['1', '2', '10', 'cat9', 'cat10']
    """
    return tuple((0, int(p), "") if p.isdecimal() else (1, 0, p) for p in re.split(r"(\d+)", name) if p)


def list_files(folder: Path, *suffixes: str) -> list[Path]:
    """Return the visible files in `folder` with one of `suffixes` (".off", any case), in natural order of their names.

    A folder that does not exist has no files.
    """
    if not folder.is_dir():
        return []
    named = (p for p in folder.iterdir() if p.suffix.lower() in suffixes and not p.name.startswith("."))
    return sorted((p for p in named if p.is_file()), key=lambda p: natural_key(p.name))


def list_folders(folder: Path, depth: int = 1) -> list[Path]:
    """Return the visible folders below `folder`, down to `depth` levels, nearest first and in natural order."""
    level, found = [folder], []
    for _ in range(depth):
        below = [p for f in level if f.is_dir() for p in f.iterdir() if p.is_dir() and not p.name.startswith(".")]
        level = sorted(below, key=lambda p: natural_key(str(p)))
        found += level
    return found


def copy_file(source: Path, target: Path) -> None:
    """Copy one file atomically; the source is only read."""
    with atomic_path(target) as temporary:
        shutil.copyfile(source, temporary)


def unpack(archive: Path, folder: Path) -> None:
    """Unpack a .tar (also .xz, .gz, .bz2) or .zip archive into `folder`, refusing entries that would leave it.

    Raises
    ------
    DataError
        If the file is no such archive, is cut short, or holds entries that point outside.
    """
    read_bytes_of_head(archive)
    try:
        if zipfile.is_zipfile(archive):
            with zipfile.ZipFile(archive) as z:
                z.extractall(folder)
        else:
            with tarfile.open(archive) as t:
                t.extractall(folder, filter="data")
    except (tarfile.TarError, zipfile.BadZipFile, EOFError, OSError, ValueError) as error:
        why = str(error).partition("\n")[0].removesuffix(":")
        raise DataError(f"{archive}: cannot be unpacked ({why}); wanted a whole .zip or .tar archive") from error


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
