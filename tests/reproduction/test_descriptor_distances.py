from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from csm.data.shapes import Shape
from csm.descriptors import preset
from csm.errors import ConfigError
from csm.mesh.correspondence import PointMap
from csm.reproduction import descriptor_distances
from csm.reproduction.descriptor_distances import Figure5, Figure6, distances_from, unit_of
from csm.reproduction.study import Findings
from csm.viewer.grid import Panel
from tests.reproduction.toys import Toys, toy_bodies, toy_context

NAMES = ("acd_isotropic", "acd_paper")
SMALL = {"size": (40, 50), "blocks": 1}


@pytest.fixture
def drawn(monkeypatch) -> dict[str, list[Panel]]:
    """Take down what is drawn."""
    rows: dict[str, list[Panel]] = {}
    draw = descriptor_distances.scalar_grid
    monkeypatch.setattr(
        descriptor_distances, "scalar_grid", lambda grid, *a, **k: rows.update(grid) or draw(grid, *a, **k)
    )
    return rows


def figure5(folder, bodies) -> Findings:
    return Figure5("figure5", source=bodies, descriptors=NAMES, **SMALL).run(toy_context(folder))


def figure6(folder, bodies, landmark="left") -> Findings:
    study = Figure6("figure6", source=bodies, descriptors=NAMES[:1], landmark=landmark, **SMALL)
    return study.run(toy_context(folder))


def test_panels_show_distances_from_the_marked_vertex(tmp_path, drawn):
    bodies = toy_bodies()
    found = figure5(tmp_path, bodies)
    assert list(drawn) == ["ACD isotropic", "ACD paper"]
    left, right = drawn["ACD isotropic"]
    values = preset("acd_isotropic")(bodies.original.load("toy0").mesh).values
    expected = [np.linalg.norm(values - values[v], axis=1) for v in bodies.landmarks.values()]
    unit = np.percentile(np.concatenate(expected), 99)
    for panel, vertex, distance in zip((left, right), bodies.landmarks.values(), expected, strict=True):
        assert panel.mark == vertex
        assert panel.values[vertex] == 0
        np.testing.assert_allclose(panel.values, distance / unit, rtol=1e-3, atol=1e-5)
    assert found.pictures[0].is_file()
    assert "99th percentile" in found.notes[0]


def test_rows_say_how_much_of_the_shape_looks_alike(tmp_path):
    found = figure5(tmp_path, toy_bodies())
    assert [(row["descriptor"], row["vertex"]) for row in found.rows] == [
        (name, vertex) for name in NAMES for vertex in ("left", "right")
    ]
    assert all(0 < row["near"] < 0.5 for row in found.rows)
    assert "mirror" not in found.columns


class MirroredToys(Toys):
    def load(self, name: str) -> Shape:
        return replace(super().load(name), mirror=PointMap.identity(162))


def test_the_mirrored_vertex_is_looked_up_where_it_is_known(tmp_path):
    bodies = replace(toy_bodies(), original=MirroredToys())
    found = figure5(tmp_path, bodies)
    assert [row["mirror"] for row in found.rows] == [0, 0, 0, 0]  # here every vertex is its own mirror image


def test_equal_descriptors_have_distance_zero_in_a_unit_of_one():
    values = np.ones((5, 3), dtype=np.float32)
    distances = distances_from(values[0], values)
    np.testing.assert_array_equal(distances, 0)
    assert unit_of([distances]) == 1


def test_columns_are_the_query_and_the_shapes_that_it_is_compared_with(tmp_path, drawn):
    bodies = toy_bodies()
    found = figure6(tmp_path, bodies)
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
    rows = figure6(tmp_path, bodies).rows
    panel, true = drawn["ACD isotropic"][1], bodies.landmarks["left"]
    assert rows[0]["distance"] == panel.values[true]
    assert rows[0]["nearer"] == np.mean(panel.values < panel.values[true])
    assert (rows[0]["error"] == 0) == (panel.values.argmin() == true)


def test_a_copy_is_found_exactly(tmp_path):
    bodies = replace(toy_bodies(), others={"a copy": Toys()})
    row = figure6(tmp_path, bodies).rows[-1]
    assert (row["shape"], row["distance"], row["nearer"], row["error"]) == ("a copy", 0, 0, 0)


def test_an_unknown_landmark_is_refused(tmp_path):
    with pytest.raises(ConfigError, match="'tail' is unknown; there are left, right"):
        figure6(tmp_path, toy_bodies(), landmark="tail")
