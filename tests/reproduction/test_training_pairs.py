from __future__ import annotations

import numpy as np
import pytest

from csm.descriptors import preset
from csm.errors import ConfigError
from csm.reproduction import training_pairs
from csm.reproduction.study import Context, Findings
from csm.reproduction.training_pairs import (
    AS_IN_TABLE,
    VARIANTS,
    Assumptions,
    Figure3,
    same_person_pairs,
    variants_of,
    vary,
)
from tests.reproduction.toys import Toys, measure_no_more, toy_context

TOYS = Toys(tuple(f"toy{i}" for i in range(20)))
GRID = {"alphas": (10, 0), "angles": (4, 20), "ks": (5, 10), "orders": (3,), "distance": "edge", "points": 40}


def figure3(context: Context, **options: object) -> Findings:
    return Figure3("figure3", shapes=TOYS, **options).run(context)  # type: ignore[arg-type]


def assumptions(context: Context, **options: object) -> Findings:
    return Assumptions("assumptions", shapes=TOYS, **options).run(context)  # type: ignore[arg-type]


def test_every_value_has_a_row_and_the_preset_is_one_setting(tmp_path):
    found = figure3(toy_context(tmp_path), n_pairs=4, **GRID)
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
    assert found.rows[0]["standard error"] == pytest.approx(np.std(found.rows[0]["pairs"], ddof=1) / 2)
    assert "mean over 4 ordered pairs of 40 points each" in found.notes[0]
    assert found.pictures[0].is_file()


def test_what_is_there_is_not_measured_again(tmp_path, monkeypatch):
    context = toy_context(tmp_path)
    first = figure3(context, n_pairs=2, **GRID)
    measure_no_more(monkeypatch)
    assert figure3(context, n_pairs=2, **GRID).rows == first.rows
    monkeypatch.undo()
    kept = len(context.results.files())
    figure3(context, n_pairs=2, **GRID | {"orders": (3, 4)})
    assert len(context.results.files()) == kept + 2  # the two targets of the new setting


def test_only_acd_has_these_parameters(tmp_path):
    with pytest.raises(ConfigError, match="hks is not a preset of ACD"):
        figure3(toy_context(tmp_path), base="hks")


def test_without_anisotropy_one_angle_is_left():
    centre = preset("acd_paper")
    assert (vary(centre, "alpha", 0).angles, vary(centre, "alpha", 3).angles) == (1, 20)
    assert vary(centre, "k", 7) == preset("acd_paper", k=7)


@pytest.mark.parametrize("name", VARIANTS)
def test_every_variant_is_another_descriptor_of_its_family(name):
    found = variants_of(name)
    assert next(iter(found)) == AS_IN_TABLE
    assert len(set(found.values())) == len(found) == 1 + len(VARIANTS[name])
    assert len({type(descriptor) for descriptor in found.values()}) == 1


def test_the_table_holds_every_variant_beside_the_preset(tmp_path, monkeypatch):
    few = {"smwd": {"6 filters": {"n_filters": 6}}, "amks": {"unit area": {"units": "unit_area"}}}
    monkeypatch.setattr(training_pairs, "VARIANTS", few)
    found = assumptions(toy_context(tmp_path), descriptors=("smwd", "amks"), n_pairs=2, points=40, distance="edge")
    assert [(row["descriptor"], row["variant"], row["paper"]) for row in found.rows] == [
        ("smwd", AS_IN_TABLE, 183),
        ("smwd", "6 filters", 183),
        ("amks", AS_IN_TABLE, 152),
        ("amks", "unit area", 152),
    ]
    assert all(row["error"] > 0 and len(row["pairs"]) == 2 for row in found.rows)
    assert found.pictures[0].is_file()


def test_a_descriptor_without_guesses_is_refused(tmp_path):
    with pytest.raises(ConfigError, match="weds to vary; there is wft"):
        assumptions(toy_context(tmp_path), descriptors=("weds",))


def test_without_data_the_built_in_humans_are_taken(tmp_path):
    assert Figure3("figure3").shape_set(toy_context(tmp_path)).name.endswith("remeshed_5000")


def test_pairs_are_two_poses_of_one_training_person_both_ways():
    names = [str(i) for i in range(100)]
    found = same_person_pairs(names, 32, seed=1)
    assert found[1::2] == [(b, a) for a, b in found[::2]]
    people = [int(a) // 10 for a, _ in found]
    assert people == [int(b) // 10 for _, b in found]
    assert sorted(people) == sorted(4 * list(range(8)))
    assert len({name for pair in found for name in pair}) == 32
    assert found[:16] == same_person_pairs(names, 16, seed=1)
    assert len(set(same_person_pairs(names, 80, seed=1))) == 80
    for wrong in (0, 3, 82):
        with pytest.raises(ConfigError, match="from 2 to 80"):
            same_person_pairs(names, wrong, seed=0)


def test_persons_with_few_poses_give_fewer_pairs():
    assert len(same_person_pairs([str(i) for i in range(13)], 12, seed=0)) == 12
    with pytest.raises(ConfigError, match="from 2 to 12"):
        same_person_pairs([str(i) for i in range(13)], 14, seed=0)
