"""What is said about the process that made a number."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import csm
from csm.evaluation import provenance as module
from csm.evaluation.provenance import provenance


def test_a_module_is_named_as_it_is_run() -> None:
    script = str(Path(csm.__file__).parent / "commands" / "train.py")
    assert provenance([script, "a=1", "b=x y"]).command == "python -m csm.commands.train a=1 'b=x y'"
    assert provenance(["/somewhere/bin/csm", "check"]).command == "csm check"


def test_versions_are_those_imported() -> None:
    versions = provenance().versions
    assert versions["numpy"] == np.__version__
    assert versions["csm"] == csm.__version__
    assert versions["python"] == sys.version.split()[0]


def checkout(folder: Path) -> str:
    (folder / "csm").mkdir()
    (folder / "csm" / "a.py").write_text("1")
    for words in (["init", "-q"], ["add", "."], ["-c", "user.name=a", "-c", "user.email=b@c", "commit", "-qm", "x"]):
        subprocess.run(["git", *words], cwd=folder, check=True)
    head = subprocess.run(["git", "rev-parse", "HEAD"], cwd=folder, check=True, capture_output=True, text=True)
    return head.stdout[:12]


def test_commit_of_a_checkout_and_its_changes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    head = checkout(tmp_path)
    monkeypatch.setattr(module, "_PACKAGE", tmp_path / "csm")
    assert provenance().commit == head
    (tmp_path / "notes.txt").write_text("outside the code")
    assert provenance().commit == head
    (tmp_path / "csm" / "a.py").write_text("2")
    assert provenance().commit == f"{head}-dirty"


def test_an_installed_package_inside_another_checkout_gives_its_version(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    checkout(tmp_path)
    monkeypatch.setattr(module, "_PACKAGE", tmp_path / "venv" / "csm")
    (tmp_path / "venv" / "csm").mkdir(parents=True)
    assert provenance().commit == f"csm {csm.__version__}"
