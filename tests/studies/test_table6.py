from __future__ import annotations

import pytest

from csm.data.store import Store
from csm.errors import ConfigError
from csm.studies import table6
from csm.studies.contenders import CONTENDERS
from csm.studies.study import Context
from csm.studies.table6 import run
from tests.shapes import blob


@pytest.fixture
def context(tmp_path, monkeypatch) -> Context:
    monkeypatch.setattr(table6, "timed_mesh", lambda *_: (blob(3), "a blob"))
    return Context(tmp_path / "data", tmp_path / "out", Store(tmp_path / "store"))


def test_rows_have_parameters_seconds_memory_and_ratios_and_are_kept(context, monkeypatch):
    findings = run(context, contenders=["csmcnn", "mlp"], repeats=2, threads=1)
    first, second = findings.rows
    assert first["parameters"] - first["without classifier"] == (256 + 1) * 642
    assert first["without classifier"] == 1_906_602 - 1_770_730
    assert (first["train to csmcnn"], first["test to csmcnn"]) == (1, 1)
    assert second["train epoch s"] == pytest.approx(80 * sorted(second["measurements"]["train"])[0], rel=1)
    assert findings.pictures[0].is_file()
    assert second["MB"] >= 0, "small networks fit in what the process had at its peak before"

    def never(*_):
        raise AssertionError("what is there is not measured again")

    monkeypatch.setattr(table6, "cost_of", never)
    assert run(context, contenders=["csmcnn", "mlp"], repeats=2, threads=1).markdown() == findings.markdown()
    with pytest.raises(AssertionError):
        run(context, contenders=["mlp"], repeats=3, threads=1)


@pytest.mark.parametrize("options", [{"contenders": []}, {"contenders": ["nope"]}, {"repeats": 0}, {"threads": 0}])
def test_wrong_options_are_refused(context, options):
    with pytest.raises(ConfigError, match="table6"):
        run(context, **options)


def test_without_the_reference_there_is_no_ratio(context):
    (row,) = run(context, contenders=["mlp"], repeats=1, threads=1).rows
    assert row["train to csmcnn"] is None
    assert row["method"] == CONTENDERS["mlp"].title
