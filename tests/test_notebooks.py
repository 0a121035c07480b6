"""The notebooks run from the first cell to the last."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.conftest import ROOT

NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))
PRINTED = {"match.ipynb": "thousandths of the diameter", "train.ipynb": "remeshed, 5000 vertices"}


def test_they_are_kept_without_outputs():
    assert [path.name for path in NOTEBOOKS] == list(PRINTED)
    for path in NOTEBOOKS:
        text = path.read_text(encoding="utf-8")
        assert text.count('"outputs": []') == text.count('"cell_type": "code"')


@pytest.mark.long
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_they_run(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    nbformat = pytest.importorskip("nbformat", reason='needs pip install "csm-correspondence[notebooks]"')
    nbclient = pytest.importorskip("nbclient", reason='needs pip install "csm-correspondence[notebooks]"')
    monkeypatch.setenv("CSM_CACHE", str(tmp_path / "store"))
    book = nbformat.read(path, as_version=4)
    nbclient.NotebookClient(book, timeout=1200, resources={"metadata": {"path": str(tmp_path)}}).execute()
    outputs = [output for cell in book.cells for output in cell.get("outputs", ())]
    assert PRINTED[path.name] in "".join(str(output.get("text", "")) for output in outputs)
    assert path.stem != "match" or any("text/html" in output.get("data", ()) for output in outputs)
