from __future__ import annotations

import numpy as np
import pytest

from csm.descriptors.acd import ACD
from csm.errors import ConfigError
from csm.studies import couples, figure3
from tests.studies.toys import Toys, toy_context

NAMES = tuple(f"toy{i}" for i in range(20))
GRID = {"alphas": (10, 0), "angles": (4, 20), "ks": (5, 10), "orders": (3,), "distance": "edge", "points": 40}


def test_every_value_has_a_row_and_the_preset_is_one_setting(tmp_path):
    context = toy_context(tmp_path)
    found = figure3.run(context, shapes=Toys(NAMES), n_pairs=4, **GRID)
    assert [(row["parameter"], row["value"]) for row in found.rows] == [
        ("alpha", 0),
        ("alpha", 10),
        ("angles", 4),
        ("angles", 20),
        ("k", 5),
        ("k", 10),
        ("order", 3),
    ]
    of_preset = [row["pairs"] for row in found.rows if row["value"] in (20, 10)]
    assert of_preset[0] == of_preset[1] == of_preset[2]
    assert all(len(row["pairs"]) == 4 for row in found.rows)
    assert found.rows[0]["columns"] == 7
    assert found.rows[0]["error"] == pytest.approx(np.mean(found.rows[0]["pairs"]))
    assert found.pictures[0].is_file()


def test_what_is_there_is_not_measured_again(tmp_path, monkeypatch):
    context = toy_context(tmp_path)
    first = figure3.run(context, shapes=Toys(NAMES), n_pairs=2, **GRID)
    asked: list[ACD] = []
    measure = couples.couple_errors

    def spy(one, other, settings, task):
        asked.extend(settings)
        return measure(one, other, settings, task)

    monkeypatch.setattr("csm.studies.couples.couple_errors", spy)
    again = figure3.run(context, shapes=Toys(NAMES), n_pairs=2, **GRID)
    assert again.rows == first.rows
    assert asked == []
    figure3.run(context, shapes=Toys(NAMES), n_pairs=2, **GRID | {"orders": (3, 4)})
    assert asked == [ACD(order=4)]


def test_only_acd_has_these_parameters(tmp_path):
    with pytest.raises(ConfigError, match="hks is not a preset of ACD"):
        figure3.run(toy_context(tmp_path), shapes=Toys(NAMES), base="hks")
