from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from csm.data.shapeset import Shape
from csm.descriptors.acd import ACD
from csm.mesh.correspondence import PointMap
from csm.studies import figure5
from csm.viewer.grid import Panel
from tests.studies.toys import Toys, toy_bodies, toy_context

NAMES = ("acd_isotropic", "acd_paper")
SMALL = {"descriptors": NAMES, "size": (40, 50), "blocks": 1}


@pytest.fixture
def drawn(monkeypatch) -> dict[str, list[Panel]]:
    """Take down what is drawn."""
    rows: dict[str, list[Panel]] = {}
    draw = figure5.scalar_grid
    monkeypatch.setattr(figure5, "scalar_grid", lambda grid, *a, **k: rows.update(grid) or draw(grid, *a, **k))
    return rows


def test_panels_show_distances_from_the_marked_vertex(tmp_path, drawn):
    bodies = toy_bodies()
    found = figure5.run(toy_context(tmp_path), source=bodies, **SMALL)
    assert list(drawn) == ["ACD isotropic", "ACD paper"]
    left, right = drawn["ACD isotropic"]
    values = ACD(alpha=0.0, angles=1)(bodies.original.load("toy0").mesh).values
    expected = [np.linalg.norm(values - values[v], axis=1) for v in bodies.landmarks.values()]
    unit = np.percentile(np.concatenate(expected), 99)
    for panel, vertex, distance in zip((left, right), bodies.landmarks.values(), expected, strict=True):
        assert panel.mark == vertex
        assert panel.values[vertex] == 0
        np.testing.assert_allclose(panel.values, distance / unit, rtol=1e-3, atol=1e-5)
    assert found.pictures[0].is_file()
    assert "99th percentile" in found.notes[0]


def test_rows_say_how_much_of_the_shape_looks_alike(tmp_path):
    found = figure5.run(toy_context(tmp_path), source=toy_bodies(), **SMALL)
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
    found = figure5.run(toy_context(tmp_path), source=bodies, **SMALL)
    assert [row["mirror"] for row in found.rows] == [0, 0, 0, 0]  # here every vertex is its own mirror image


def test_equal_descriptors_have_distance_zero():
    values = np.ones((5, 3), dtype=np.float32)
    (distance,) = figure5.normalised([figure5.distances_from(values[0], values)])
    np.testing.assert_array_equal(distance, 0)
