"""Files and folders: reading, atomic writing, natural order."""

from __future__ import annotations

import hashlib
import os
import re
import secrets
import shutil
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
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
    is hidden, ends like `path` (writers look at the suffix) and is removed when the block raises.  A file that is
    replaced keeps its permissions; where `path` is a link, the file it points to is replaced and the link stays.

    Raises
    ------
    DataError
        If nothing can be written there: a read-only folder, a full disk, a name that is too long, a folder of that
        name, a file where a folder has to be.

    Examples
    --------
    >>> import tempfile
    >>> folder = Path(tempfile.mkdtemp())
    >>> with atomic_path(folder / "new" / "a.txt") as temporary:
    ...     _ = temporary.write_text("whole")
    >>> (folder / "new" / "a.txt").read_text()
    'whole'
    """
    with _writing(path, ()):
        final, mode = _place(path)
        final.parent.mkdir(parents=True, exist_ok=True)
    temporary = final.with_name(_temporary_name(final))
    with _writing(path, (final, temporary)):
        try:
            yield temporary
            if mode is not None:
                temporary.chmod(mode)
            os.replace(temporary, final)
        finally:
            with suppress(OSError):
                temporary.unlink(missing_ok=True)


def _place(path: str | os.PathLike[str]) -> tuple[Path, int | None]:
    """Return where `path` leads and the permissions of the file that is there, None if there is none."""
    final = Path(path)
    if final.is_symlink():
        final = Path(os.path.realpath(final))
        if final.is_symlink():
            raise DataError(f"{path}: cannot be written: it is a link in a circle")
    try:
        mode = final.stat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        return final, None
    if stat.S_ISDIR(mode):
        raise DataError(f"{path}: cannot be written: there is a folder of this name")
    if not stat.S_ISREG(mode):
        raise DataError(f"{path}: cannot be written: it is no file but a device, a pipe or a socket")
    return final, stat.S_IMODE(mode)


def _temporary_name(final: Path) -> str:
    """Return a hidden name that ends like the file's and has at most the 255 bytes that file systems allow."""
    suffix = final.suffix if len(os.fsencode(final.suffix)) <= 32 else ""
    room = 255 - len(os.fsencode(f"..{secrets.token_hex(4)}.tmp{suffix}"))
    stem = os.fsdecode(os.fsencode(final.stem)[:room])
    return f".{stem}.{secrets.token_hex(4)}.tmp{suffix}"


@contextmanager
def _writing(path: str | os.PathLike[str], own: tuple[Path, ...]) -> Iterator[None]:
    """Turn what the system says while `path` is written into one sentence; errors of other files pass, if `own`."""
    try:
        yield
    except FileExistsError as error:
        raise DataError(f"{path}: cannot be written: {error.filename} is a file, wanted a folder") from error
    except NotADirectoryError as error:
        raise DataError(f"{path}: cannot be written: a part of this path is a file, wanted a folder") from error
    except OSError as error:
        if own and error.filename is not None and Path(os.fsdecode(error.filename)) not in own:
            raise
        raise DataError(f"{path}: cannot be written ({error.strerror or error})") from error
    except ValueError as error:
        if own:
            raise
        raise DataError(f"{str(path)!r}: cannot be written ({error})") from error  # a name with a zero byte


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
    """Copy one file atomically; the source is only read.

    Raises
    ------
    DataError
        If the source is no file that can be read, or the target cannot be written.
    """
    require_regular(source)
    with refusals(source), source.open("rb") as original, atomic_path(target) as new, new.open("wb") as copy:
        shutil.copyfileobj(original, copy, 1 << 20)


def file_digest(path: Path) -> str:
    """Return the SHA-256 (hex) of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()
