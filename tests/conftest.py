"""Fixtures shared by all tests; see `tests/shapes.py` for the synthetic meshes."""

from __future__ import annotations

import os
import signal
import tarfile
from collections.abc import Callable
from pathlib import Path

import pytest

signal.signal(
    signal.SIGINT, signal.default_int_handler
)  # a job in the background ignores it, and so would its children

ROOT = Path(__file__).resolve().parent.parent


def data_folder() -> Path | None:
    """Return the folder of the research archives, `CSM_DATA` or ../shared/data, if there is one."""
    for candidate in (os.environ.get("CSM_DATA"), ROOT.parent / "shared" / "data"):
        if candidate and Path(candidate).is_dir():
            return Path(candidate)
    return None


@pytest.fixture(scope="session")
def data_set(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Return a function that gives the unpacked folder of a set such as "FAUST_6890", or skips the test."""
    unpacked: dict[str, Path] = {}

    def get(name: str) -> Path:
        if name in unpacked:
            return unpacked[name]
        root = data_folder()
        if root is None:
            pytest.skip("needs the research data sets: set CSM_DATA to their folder")
        if (root / name).is_dir():
            unpacked[name] = root / name
        elif (root / f"{name}.tar.xz").is_file():
            target = tmp_path_factory.mktemp("data")
            with tarfile.open(root / f"{name}.tar.xz") as archive:
                archive.extractall(target, filter="data")
            unpacked[name] = target / name
        else:
            pytest.skip(f"{root} has neither {name}/ nor {name}.tar.xz")
        return unpacked[name]

    return get
