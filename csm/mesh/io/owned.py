"""Which files csm has written: an account beside them, a json, has the hash of each; nothing else is ever replaced."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from csm.errors import DataError
from csm.mesh.io.files import atomic_path, copy_file, file_digest

MATCH, COLLECTION = "match.json", "collection.json"
"""Accounts of a match of two meshes and of a matched collection."""

_IN_PYTHON = "give another folder, or overwrite=True to replace it"


def require_own(outputs: Iterable[Path], account: Path, overwrite: bool = False, remedy: str = _IN_PYTHON) -> None:
    """Raise if a file to be written is there and is not as csm left it.

    Parameters
    ----------
    outputs
        The files to be written, without the account.
    account
        The json that an earlier run wrote with them: it has the hash of each under "files", by its path from there.
    overwrite
        Whether to let all of them be replaced.
    remedy
        What the user can do, in the words of the place where the files were asked for.

    Raises
    ------
    DataError
        With the first such file, or where a match of another kind is in the folder.
    """
    if overwrite:
        return
    files = files_of(account)
    for path in outputs:
        name = path.relative_to(account.parent).as_posix()
        if os.path.lexists(path) and not is_as_left(path, files.get(name)):
            why = "has been changed since csm wrote it" if name in files else "was not written by csm here"
            raise DataError(f"{path}: there is such a file, which {why}; {remedy}")
    if os.path.lexists(account) and not files:
        raise DataError(f"{account}: there is such a file, which was not written by csm here; {remedy}")
    _require_alone(account, remedy)


def _require_alone(account: Path, remedy: str) -> None:
    """Raise if the result of the other kind of match is in the folder: which files are whose could not be told."""
    other = {MATCH: COLLECTION, COLLECTION: MATCH}.get(account.name)
    if other and files_of(account.parent / other):
        what = "a match of two meshes" if other == MATCH else "a matched folder"
        instead = remedy.replace("to replace it", "to have both in it")
        raise DataError(f"{account.parent}: this folder has the files of {what} ({other}); {instead}")


def require_not_input(outputs: Iterable[Path], inputs: Iterable[Path]) -> None:
    """Raise if an output is one of the files that were read, by whatever name.

    Raises
    ------
    DataError
        With the file.
    """
    read = {_identity(path): path for path in inputs}
    for path in outputs:
        if _identity(path) in read:
            raise DataError(
                f"{path}: this is the input {read[_identity(path)]}, which would be replaced; choose another place"
            )


def _identity(path: Path) -> Any:
    try:
        found = path.stat()
    except OSError:
        return os.path.realpath(path)
    return found.st_dev, found.st_ino


def files_of(account: Path) -> Mapping[str, str]:
    """Return the hashes of the files of an account by their paths from there; none if it is no account of csm."""
    if not account.is_file():
        return {}
    try:
        files = json.loads(account.read_text(encoding="utf-8")).get("files")
    except (OSError, ValueError, AttributeError, RecursionError):
        return {}
    return files if isinstance(files, dict) else {}


def is_as_left(path: Path, digest: str | None) -> bool:
    """Tell whether a file has the content that its account says."""
    return digest is not None and path.is_file() and file_digest(path) == digest


def put_in_place(staged: Path, names: Iterable[str], account: Path, said: Mapping[str, Any]) -> None:
    """Put finished files beside their account, each under a temporary name first, and the account before all of them.

    So what of them comes to its place is known as csm's, even where the process ends in between.

    Parameters
    ----------
    staged
        The folder that holds the finished files.
    names
        Their paths, relative to it.
    account
        The json to write; the files go beside it.
    said
        What it says; the hashes of the files are added as "files".
    """
    names = list(names)
    content = {**said, "files": {name: file_digest(staged / name) for name in names}}
    with atomic_path(account) as temporary:
        temporary.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    for name in names:
        copy_file(staged / name, account.parent / name)


def remove_left(account: Path, files: Mapping[str, str]) -> None:
    """Remove files of an earlier run that are still as it left them; links and files changed since stay."""
    for name, digest in files.items():
        path = account.parent / name
        if not path.is_symlink() and is_as_left(path, digest):
            path.unlink()
