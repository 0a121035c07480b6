"""The page on additions: its six files and five registry lines are added to a copy of csm, and its commands are run."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parent.parent
PAGE = (ROOT / "docs" / "extending.md").read_text(encoding="utf-8")
BLOCK = re.compile(r"^```(?:python|yaml) (\S+)(?: (\S+))?\n(.*?)^```$", re.DOTALL | re.MULTILINE)
COMMANDS = [line for line in re.findall(r"```sh\n(.*?)```", PAGE, re.DOTALL)[-1].splitlines() if line]


def test_every_addition_is_one_file_and_at_most_one_line():
    files = [path for path, registry, _ in BLOCK.findall(PAGE) if not registry]
    lines = [text for _, registry, text in BLOCK.findall(PAGE) if registry]
    assert len(files) == 6
    assert len(lines) == 5
    assert all(text.count("\n") == 1 for text in lines)
    assert not [path for path in files if (ROOT / path).exists()]


@pytest.fixture(scope="module")
def extended(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a copy of csm and its configuration, to which the page's files and lines are added."""
    copy = tmp_path_factory.mktemp("extended")
    for name in ("csm", "conf"):
        shutil.copytree(ROOT / name, copy / name, ignore=shutil.ignore_patterns("__pycache__"))
    for place, registry, text in BLOCK.findall(PAGE):
        path = copy / place
        if not registry:
            path.write_text(text, encoding="utf-8")
            continue
        head = re.compile(rf"^{registry}\b.*\{{\n", re.MULTILINE)
        code = path.read_text(encoding="utf-8")
        assert len(head.findall(code)) == 1, f"{place} has no {registry}"
        path.write_text(head.sub(lambda found, line=text: found[0] + line, code), encoding="utf-8")
    (making,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    subprocess.run([sys.executable, "-c", making], cwd=copy, check=True)
    return copy


def run(folder: Path, line: str) -> str:
    _, *words = shlex.split(line)
    code = "from csm.commands.main import main; main()"
    variables = os.environ | {"PYTHONPATH": str(folder), "CSM_CACHE": str(folder / "store")}
    ended = subprocess.run(
        [sys.executable, "-c", code, *words], cwd=folder, env=variables, capture_output=True, text=True
    )
    assert ended.returncode == 0, ended.stderr
    return ended.stdout


def test_the_copy_is_what_runs(extended):
    code = "import csm; print(csm.__file__)"
    variables = os.environ | {"PYTHONPATH": str(extended)}
    where = subprocess.run([sys.executable, "-c", code], cwd=extended, env=variables, capture_output=True, text=True)
    assert where.stdout.startswith(str(extended))


@pytest.mark.long
def test_all_six_work_together(extended):
    for line in COMMANDS:
        assert line.startswith("csm ")
        run(extended, line)
    with np.load(extended / "power.npz") as found:
        assert found["values"].shape == (162, 4)
    rows = json.loads((extended / "run/rows.json").read_text())
    assert [(row["matching"], row["test"]) for row in rows] == [("nearest", "HANDS"), ("standardised", "HANDS")]
    assert rows[0]["age"] != rows[1]["age"]
    assert (extended / "run/steps/metrics.csv").is_file()
    study = json.loads((extended / "outputs/reproduce/poses.json").read_text())
    assert [(row["descriptor"], row["person"]) for row in study["rows"]] == [("power", "s00")]
    assert "hands, called HANDS" in run(extended, "csm check hands")
