from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from csm.data.datasets import find_set
from csm.data.folderset import FolderSet
from csm.data.store import Store
from csm.descriptors import preset
from csm.errors import DataError
from csm.evaluation.protocol import Protocol
from csm.studies import cells as module
from csm.studies.cells import fill_cells, read_cell, write_cell
from csm.studies.matching import Rules
from csm.studies.study import Context
from tests.remeshedset import write_faust

DESCRIPTORS = {"acd": preset("acd_paper", angles=4), "amks": preset("amks", k=20, n_energies=10)}


@pytest.fixture
def faust(tmp_path) -> FolderSet:
    return find_set(write_faust(tmp_path / "FAUST"), "FAUST_5k_remeshed")


@pytest.fixture
def context(tmp_path) -> Context:
    return Context(tmp_path, tmp_path / "out", Store(tmp_path / "store"))


def rules(faust: FolderSet, exact_points: int = 30) -> Rules:
    return Rules(Protocol(faust.mapped_pairs), exact_points)


def test_a_cell_is_what_its_pairs_say(context, faust):
    cells = fill_cells(context, faust, faust.mapped_pairs, DESCRIPTORS, rules(faust))
    for cell in cells.values():
        ages = [row["age"] for row in cell.pairs]
        assert sorted((row["source"], row["target"]) for row in cell.pairs) == sorted(faust.mapped_pairs)
        assert cell.age == pytest.approx(np.mean(ages))
        assert cell.std == pytest.approx(np.std(ages))
        assert 0 < cell.uncertainty < 0.02
        assert cell.cqc[-1] <= 1
        assert cell.failures == {}


def test_a_cell_survives_the_disk(context, faust, tmp_path):
    (cell,) = fill_cells(context, faust, faust.mapped_pairs, {"acd": DESCRIPTORS["acd"]}, rules(faust)).values()
    write_cell(tmp_path / "cell.json", cell)
    again = read_cell(tmp_path / "cell.json")
    np.testing.assert_array_equal(again.cqc, cell.cqc)
    for name in ("question", "summary", "std", "uncertainty", "pairs", "failures", "made"):
        assert json.dumps(getattr(again, name), default=vars) == json.dumps(getattr(cell, name), default=vars)


def test_cells_that_are_there_are_not_made_again_unless_the_question_is_another(context, faust, monkeypatch, caplog):
    made = []
    honest = module.match_pairs
    monkeypatch.setattr(module, "match_pairs", lambda s, p, d, *a: made.append(sorted(d)) or honest(s, p, d, *a))
    pairs = faust.mapped_pairs
    first = fill_cells(context, faust, pairs, DESCRIPTORS, rules(faust))
    again = fill_cells(context, faust, pairs, DESCRIPTORS, rules(faust))
    assert made == [["acd", "amks"]]
    assert again["acd"].age == first["acd"].age
    fill_cells(context, faust, pairs, DESCRIPTORS, rules(faust, 40))
    assert "another question" in caplog.text
    other = DESCRIPTORS | {"acd": replace(DESCRIPTORS["acd"], alpha=3.0)}
    fill_cells(context, faust, pairs, other, rules(faust, 40))
    (context.out / "cells" / faust.name / "amks.json").write_text("{")
    fill_cells(context, faust, pairs, other, rules(faust, 40))
    assert made[1:] == [["acd", "amks"], ["acd"], ["amks"]]


def test_shapes_that_fail_are_left_out_with_their_pairs(context, faust):
    path = faust.entry("tr_reg_010").mesh
    whole = path.read_text()
    path.write_text(whole.replace("162 320 0", "163 320 0"))
    cells = fill_cells(context, faust, faust.mapped_pairs, DESCRIPTORS, rules(faust))
    assert list(cells["acd"].failures) == ["tr_reg_010"]
    assert len(cells["acd"].pairs) == 3
    with pytest.raises(DataError, match="none of the 1 pairs"):
        fill_cells(context, faust, [("tr_reg_010", "tr_reg_011")], DESCRIPTORS, rules(faust))
    path.write_text(whole)
    mended = fill_cells(context, faust, faust.mapped_pairs, DESCRIPTORS, rules(faust))
    assert mended["acd"].failures == {}
    assert len(mended["acd"].pairs) > 3
