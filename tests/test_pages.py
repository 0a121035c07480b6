"""The pages on Python and the tutorials: their code runs as it stands, from the first block to the last."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

DOCS = Path(__file__).resolve().parent.parent / "docs"
PRINTED = {
    "python": [
        r"Match\(s00_p00 -> s01_p02 by acd, nearest\+multistart\)",
        r"\(6899, 100\)",
        r"humans nearest 0\.\d+\n",
    ],
    "tutorial_match": [r"vertices|partner|trust", r"\[\d+ +\d+ +\d+ +\d+ +\d+\]"],
    "tutorial_resolutions": [r"3000 \d+\.\d\n5000 \d+\.\d\n"],
    "data": [r"\d+\.\d thousandths of the diameter"],
}


@pytest.mark.long
@pytest.mark.parametrize("page", PRINTED)
def test_the_code_of_the_page_runs(page, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("CSM_CACHE", str(tmp_path / "store"))
    text = (DOCS / f"{page}.md").read_text(encoding="utf-8")
    names: dict[str, object] = {}
    for block in re.findall(r"```python\n(.*?)```", text, re.DOTALL):
        exec(compile(block, f"{page}.md", "exec"), names)
    printed = capsys.readouterr().out
    for pattern in PRINTED[page]:
        assert re.search(pattern, printed), pattern
