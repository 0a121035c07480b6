from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

from csm.data.store import Store
from csm.studies.figure4 import WITHIN, run
from csm.studies.study import Context
from csm.studies.table1 import run as run_table1
from tests.remeshedset import write_faust, write_tosca

OPTIONS = {"sets": ["faust", "tosca"], "descriptors": ["acd_paper", "smwd"], "exact_points": 20}


@pytest.fixture(scope="module")
def context(tmp_path_factory) -> Context:
    folder = tmp_path_factory.mktemp("figure4")
    write_faust(folder / "data" / "FAUST")
    write_tosca(folder / "data" / "TOSCA")
    return Context(folder / "data", folder / "out", Store(folder / "store"))


def test_curves_are_those_of_table_1_and_drawn_in_one_picture(context, monkeypatch):
    table = run_table1(context, **OPTIONS)
    monkeypatch.setattr("csm.studies.cells.match_pairs", lambda *_: pytest.fail("measured again"))
    findings = run(context, **OPTIONS)
    assert [(row["set"], row["descriptor"]) for row in findings.rows] == [
        (title, name) for title in ("FAUST", "TOSCA") for name in OPTIONS["descriptors"]
    ]
    for row in findings.rows:
        (line,) = (r for r in table.rows if r["descriptor"] == row["descriptor"])
        assert row["area under the curve"] == line["faust" if row["set"] == "FAUST" else "tosca"]["auc"]
        curve = dict(zip(np.round(row["thresholds"], 6), row["cqc"], strict=True))
        for limit in WITHIN:
            assert row[f"% within {limit:g}"] == pytest.approx(100 * curve[limit])
    (path,) = findings.pictures
    assert Image.open(path).width > Image.open(path).height
