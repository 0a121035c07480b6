from __future__ import annotations

import numpy as np
import pytest

from csm.data.registry import find_set
from csm.data.store import Store
from csm.errors import ConfigError
from csm.evaluation.engine import evaluate
from csm.evaluation.protocol import EvaluationProtocol
from csm.reproduction.refinement import Refinement
from csm.reproduction.study import Context, Findings
from tests.remeshedset import write_faust, write_shrec19, write_tosca


def run(context: Context, **options: object) -> Findings:
    return Refinement("refinement", **options).run(context)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def context(tmp_path_factory) -> Context:
    folder = tmp_path_factory.mktemp("refinement")
    write_faust(folder / "data" / "FAUST")
    write_shrec19(folder / "data" / "SHREC19")
    write_tosca(folder / "data" / "TOSCA")
    return Context(folder / "data", folder / "out", Store(folder / "store"))


@pytest.fixture(scope="module")
def findings(context) -> Findings:
    return run(context, descriptors=("acd_paper",), refine=("none", "joint"), exact_points=None)


def test_there_is_a_row_for_each_way_to_match(findings):
    assert [(row["method"], row["map"]) for row in findings.rows] == [
        ("acd_paper", "nearest"),
        ("acd_paper", "nearest+joint"),
    ]
    for row in findings.rows:
        for title in ("FAUST", "SHREC'19", "TOSCA"):
            assert row[title] == round(1000 * row[f"{title} summary"]["age"], 1)
            assert row[f"{title} summary"]["worst pair"] >= row[f"{title} summary"]["age"]
    assert findings.pictures[0].is_file()


def test_errors_are_those_of_the_engine(context, findings):
    shapes = find_set(context.root, "TOSCA_5k_remeshed")
    protocol = EvaluationProtocol([("cat0", "cat1"), ("cat1", "cat2")])
    (wanted,) = evaluate("acd_paper", shapes, protocol, refine="joint", store=context.store, workers=1, progress=False)
    assert findings.rows[1]["TOSCA summary"]["age"] == pytest.approx(wanted.summary["age"], rel=1e-5)


def test_shapes_that_nothing_was_tuned_on_have_a_column(findings):
    row = findings.rows[0]
    assert "TOSCA unseen" not in row or np.isfinite(row["TOSCA unseen"])
    assert "SHREC'19 unseen" not in row


def test_what_is_asked_for_has_to_be_something(context):
    with pytest.raises(ConfigError, match="wanted some sets"):
        run(context, refine=())
    with pytest.raises(ConfigError, match="name a descriptor"):
        run(context, descriptors=("none",))
