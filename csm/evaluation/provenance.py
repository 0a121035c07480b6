"""Where a number comes from: the command, the state of the code and the versions of the libraries."""

from __future__ import annotations

import platform
import shlex
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path

import csm

_PACKAGE = Path(csm.__file__).resolve().parent
_LIBRARIES = ("torch", "lightning", "numpy", "scipy", "pygeodesic", "potpourri3d")


_typed: list[str] = []


@dataclass(frozen=True)
class Provenance:
    """What is needed to make a number again.

    Parameters
    ----------
    command
        As typed in a shell.
    commit
        Commit of the checkout, with "-dirty" if the code was changed since; the version of csm if it is installed.
    versions
        Of Python, csm and the libraries that numbers depend on.
    """

    command: str
    commit: str
    versions: dict[str, str] = field(hash=False)


def provenance(argv: Sequence[str] | None = None) -> Provenance:
    """Describe this process (or the command line `argv`, whose first word is the program).

    Examples
    --------
    >>> provenance(["/usr/bin/csm", "train", "experiment=demo", "name=two words"]).command
    "csm train experiment=demo 'name=two words'"
    """
    words = remembered_command() if argv is None else list(argv)
    program, *arguments = words or ["python"]
    command = " ".join([_program(program), *map(shlex.quote, arguments)])
    return Provenance(command, _commit() or f"csm {csm.__version__}", _versions())


def remembered_command() -> list[str]:
    """Return the command line of this process as it was typed."""
    return list(_typed or sys.argv)


def remember_command(argv: Sequence[str]) -> None:
    """Keep a command line as it was typed, before it is put into the words of Hydra."""
    _typed[:] = argv


def _program(path: str) -> str:
    """Name a script without its folder, and a module of csm as it is run."""
    resolved = Path(path).resolve()
    if resolved.suffix == ".py" and resolved.is_relative_to(_PACKAGE):
        inside = resolved.relative_to(_PACKAGE.parent).with_suffix("")
        return f"python -m {'.'.join(inside.parts).removesuffix('.__main__')}"
    if resolved.name.startswith("csm "):  # the program with its command, as `csm.commands.main` calls it
        return resolved.name
    return shlex.quote(resolved.name)


def _commit() -> str:
    """Return the commit of the checkout that csm is imported from, empty if it is installed."""
    if _git("rev-parse", "--show-toplevel") != str(_PACKAGE.parent):
        return ""
    dirty = _git("status", "--porcelain", "--", "csm", "conf", "pyproject.toml")
    return _git("rev-parse", "--short=12", "HEAD") + ("-dirty" if dirty else "")


def _git(*arguments: str) -> str:
    try:
        run = subprocess.run(["git", *arguments], cwd=_PACKAGE.parent, capture_output=True, text=True, timeout=20)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return run.stdout.strip() if run.returncode == 0 else ""


def _versions() -> dict[str, str]:
    found = {"python": platform.python_version(), "csm": csm.__version__}
    for name in _LIBRARIES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            found[name] = "not installed"
    return found
