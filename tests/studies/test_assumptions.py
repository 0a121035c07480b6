from __future__ import annotations

import pytest

from csm.errors import ConfigError
from csm.studies.assumptions import AS_IN_TABLE, VARIANTS, run, variants_of
from tests.studies.toys import Toys, toy_context

NAMES = tuple(f"toy{i}" for i in range(20))


@pytest.mark.parametrize("name", VARIANTS)
def test_every_variant_is_another_descriptor_of_its_family(name):
    found = variants_of(name)
    assert next(iter(found)) == AS_IN_TABLE
    assert len(set(found.values())) == len(found)
    assert len({type(descriptor) for descriptor in found.values()}) == 1


def test_the_table_holds_every_variant_beside_the_preset(tmp_path, monkeypatch):
    few = {"smwd": {"6 filters": {"n_filters": 6}}, "amks": {"unit area": {"units": "unit_area"}}}
    monkeypatch.setattr("csm.studies.assumptions.VARIANTS", few)
    found = run(
        toy_context(tmp_path), shapes=Toys(NAMES), descriptors=["smwd", "amks"], n_pairs=2, points=40, distance="edge"
    )
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
        run(toy_context(tmp_path), shapes=Toys(NAMES), descriptors=["weds"])
