"""One process at a time: locks on a file that is read, changed and written, and on a folder in which a run works."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from filelock import FileLock, Timeout

from csm.errors import ConfigError

WAIT = 60.0
"""Seconds for which `locked` waits if it is not told otherwise; a change of a file takes far less."""

_log = logging.getLogger(__name__)


@contextmanager
def locked(path: str | os.PathLike[str], *, wait: float = WAIT) -> Iterator[None]:
    """Let one process at a time into the block, of all those that lock the same file or folder.

    The lock is a hidden empty file: `.csm.lock` in a folder, `.NAME.lock` beside a file, which need not exist.  It is
    the operating system that holds the lock, and that gives it up when the process ends in whatever way, so a lock file
    that is left over is harmless.  Where the file system cannot lock, the block runs all the same, with a warning.

    Parameters
    ----------
    path
        The file, or the folder, which has to exist.  Links are followed: all names of a file have one lock.
    wait
        Seconds to wait for another process: the default is for a short read-change-write of a file; 0 refuses at once,
        for what a training or a row of a matrix works on.

    Raises
    ------
    ConfigError
        If another process holds the lock.

    Examples
    --------
    >>> import tempfile
    >>> folder = tempfile.mkdtemp()
    >>> with locked(folder, wait=0):
    ...     Path(folder, ".csm.lock").exists()
    True
    """
    lock = FileLock(_lock_file(Path(path)), fallback_to_soft=False, poll_interval=0.01)
    held = _acquire(lock, path, wait)
    try:
        yield
    finally:
        if held:
            lock.release()


def _lock_file(path: Path) -> Path:
    real = Path(os.path.realpath(path))
    if real.is_dir():
        return real / ".csm.lock"
    real.parent.mkdir(parents=True, exist_ok=True)
    return real.with_name(f".{real.name}.lock")


def _acquire(lock: FileLock, path: str | os.PathLike[str], wait: float) -> bool:
    try:
        lock.acquire(timeout=wait)
    except Timeout:
        raise ConfigError(_refusal(path, wait)) from None
    except (OSError, NotImplementedError) as error:
        why = getattr(error, "strerror", None) or str(error)
        _log.warning("%s: cannot be locked here (%s); do not let two runs of csm write there at once", path, why)
        return False
    return True


def _refusal(path: str | os.PathLike[str], wait: float) -> str:
    if os.path.isdir(path):
        return (
            f"{path}: another run of csm is working in this folder, and two in one would lose results; "
            "wait until it has ended, or choose another folder"
        )
    return (
        f"{path}: another run of csm has kept this file locked{f' for {wait:g} s' if wait else ''}; "
        "wait until it has ended, or choose another file"
    )
