from __future__ import annotations

import json

import numpy as np
import pytest

from csm.data.store import Store
from csm.errors import ConfigError
from csm.matching.calibration import calibration_of
from csm.matching.signals import OF_MAPS, OF_REFINED
from csm.reproduction.confidence import ConfidenceStudy, Seen, draw_pairs, fitted
from csm.reproduction.study import Context
from tests.remeshedset import write_faust, write_shrec19, write_tosca


@pytest.fixture(scope="module")
def context(tmp_path_factory) -> Context:
    folder = tmp_path_factory.mktemp("confidence")
    write_faust(folder / "data" / "FAUST")
    write_shrec19(folder / "data" / "SHREC19")
    write_tosca(folder / "data" / "TOSCA")
    (folder / "out").mkdir()
    return Context(folder / "data", folder / "out", Store(folder / "store"))


def test_training_pairs_are_of_training_shapes_and_the_others_are_not(context):
    training = draw_pairs(context, 2, training=True)
    assert {asked.source[0] for asked in training} == {"FAUST", "TOSCA"}
    assert {asked.kind for asked in training} == {"whole", "source cut", "other kinds"}
    assert all(0 < asked.cut < 1 for asked in training if asked.kind == "source cut")
    assert all(asked.source[0] != asked.target[0] for asked in training if asked.kind == "other kinds")
    other = draw_pairs(context, 2, training=False)
    assert {asked.source[0] for asked in other} == {"SHREC19"}  # the toys are training shapes otherwise


def test_a_fit_writes_a_calibration_that_knows_maps_of_other_kinds(context):
    study = ConfidenceStudy("confidence", "acd_paper", pairs=2, points=60, refine=("nearest", "joint"), fit=True)
    found = study.run(context)
    record = json.loads((context.out / "calibration.json").read_text())
    assert calibration_of(record["refined"]).names == (*OF_MAPS, *OF_REFINED)
    assert "fitted" in record
    rows = {(row["map"], row["pairs"]): row for row in found.rows}
    assert rows["joint", "other kinds"]["wrong %"] == 100
    for name in ("nearest", "joint"):
        assert rows[name, "other kinds"]["mean confidence %"] < rows[name, "whole"]["mean confidence %"]
        counted = sum(count for _, _, count in rows[name, "all"]["reliability"])
        assert counted == 60 * rows[name, "all"]["count"]
    assert found.pictures[0].is_file()


def test_the_shipped_calibration_is_tried_where_nothing_is_fitted(context):
    study = ConfidenceStudy("confidence", "acd_paper", pairs=1, points=40, refine=("nearest",))
    (row, *_) = study.run(context).rows
    assert 0 <= row["Brier"] <= 1


def test_a_fit_needs_examples_of_both_kinds():
    seen = Seen("whole", "nearest", np.zeros((3, len(OF_MAPS))), np.array([True, False, True]))
    with pytest.raises(ConfigError, match="a refinement among refine"):
        fitted([seen])
