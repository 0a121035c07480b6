"""The page on Python: its code runs as it stands, from the first block to the last."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

PAGE = (Path(__file__).resolve().parent.parent / "docs" / "python.md").read_text(encoding="utf-8")


@pytest.mark.long
def test_the_code_of_the_page_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("CSM_CACHE", str(tmp_path / "store"))
    names: dict[str, object] = {}
    for block in re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL):
        exec(compile(block, "python.md", "exec"), names)
    printed = capsys.readouterr().out
    assert "Match(s00_p00 -> s01_p02 by acd, nearest+multistart)" in printed
    assert "(6899, 100)" in printed
    assert re.search(r"^humans nearest 0\.\d+$", printed, re.MULTILINE)
    assert re.search(r"^humans argmax 0\.\d+$", printed, re.MULTILINE)
    assert (tmp_path / "kept" / "matched").is_dir()
