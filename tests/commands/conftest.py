"""Fixtures of the tests of commands."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from hydra.core.global_hydra import GlobalHydra

from csm.commands.main import main


@pytest.fixture
def csm(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> Callable[..., tuple[int, str, str]]:
    """Return a function that runs ``csm WORDS`` in an empty folder and gives status, output and error output."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("CSM_CACHE", str(tmp_path / ".store"))

    def call(*words: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["csm", *words])
        GlobalHydra.instance().clear()
        status = 0
        try:
            main()
        except SystemExit as ended:
            status = int(ended.code or 0)
        return (status, *capfd.readouterr())

    return call
