from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from csm.errors import ConfigError
from csm.studies import figure6
from csm.viewer.grid import Panel
from tests.studies.toys import Toys, toy_bodies, toy_context

SMALL = {"descriptors": ("acd_isotropic",), "landmark": "left", "size": (40, 50), "blocks": 1}


@pytest.fixture
def drawn(monkeypatch) -> dict[str, list[Panel]]:
    """Take down what is drawn."""
    rows: dict[str, list[Panel]] = {}
    draw = figure6.scalar_grid
    monkeypatch.setattr(figure6, "scalar_grid", lambda grid, *a, **k: rows.update(grid) or draw(grid, *a, **k))
    return rows


def test_columns_are_the_query_and_the_shapes_that_it_is_compared_with(tmp_path, drawn):
    bodies = toy_bodies()
    found = figure6.run(toy_context(tmp_path), source=bodies, **SMALL)
    (panels,) = drawn.values()
    assert [panel.mesh.name for panel in panels] == ["toy0", "toy1", "toy2", "toy0"]
    assert [panel.mesh.n_vertices for panel in panels] == [162, 162, 162, 300]
    assert {panel.mark for panel in panels} == {bodies.landmarks["left"]}
    assert np.percentile(panels[0].values, 99) == pytest.approx(1)
    assert panels[0].values[bodies.landmarks["left"]] == 0
    assert [row["shape"] for row in found.rows] == ["other pose", "other person", "300 vertices"]
    assert found.pictures[0].is_file()


def test_scores_are_those_of_the_true_vertex(tmp_path, drawn):
    bodies = toy_bodies()
    rows = figure6.run(toy_context(tmp_path), source=bodies, **SMALL).rows
    panel, true = drawn["ACD isotropic"][1], bodies.landmarks["left"]
    assert rows[0]["distance"] == panel.values[true]
    assert rows[0]["nearer"] == np.mean(panel.values < panel.values[true])
    assert (rows[0]["error"] == 0) == (panel.values.argmin() == true)


def test_a_copy_is_found_exactly(tmp_path):
    bodies = replace(toy_bodies(), others={"a copy": Toys()})
    row = figure6.run(toy_context(tmp_path), source=bodies, **SMALL).rows[-1]
    assert (row["shape"], row["distance"], row["nearer"], row["error"]) == ("a copy", 0, 0, 0)


def test_an_unknown_landmark_is_refused(tmp_path):
    with pytest.raises(ConfigError, match="'tail' is unknown; there are left, right"):
        figure6.run(toy_context(tmp_path), source=toy_bodies(), **SMALL | {"landmark": "tail"})
