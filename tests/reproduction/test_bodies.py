"""Bodies are found where they are, and landmarks are the same points on every mesh."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from csm.data.shapes import Shape
from csm.descriptors.presets import preset
from csm.errors import ConfigError, DataError
from csm.mesh.correspondence import PointMap
from csm.reproduction.bodies import built_in_bodies, describe, faust_bodies, find_bodies, landmark_vertices
from tests.reproduction.toys import Toys, toy_bodies, toy_context


def test_without_data_the_built_in_humans_are_taken(tmp_path):
    context = toy_context(tmp_path)
    assert find_bodies("auto", context).title == "built-in humans"
    with pytest.raises(DataError, match="FAUST_6890"):
        find_bodies("faust", context)
    with pytest.raises(ConfigError, match="'fast' is unknown"):
        find_bodies("fast", context)


def test_bodies_that_are_given_are_taken(tmp_path):
    bodies = toy_bodies()
    assert find_bodies(bodies, toy_context(tmp_path)) is bodies


def test_landmarks_of_the_humans_are_where_their_names_say(tmp_path):
    bodies = built_in_bodies(toy_context(tmp_path).store)
    shape = bodies.original.load("s00_p00")
    x, y, z = (shape.mesh.vertices[:, k] for k in range(3))
    hand, knee, head = (landmark_vertices(bodies, shape)[name] for name in ("left hand", "left knee", "head"))
    assert x[hand] > 0.95 * x.max()
    assert z[head] > 0.99 * z.max()
    assert x[knee] > 0.1
    assert 0.2 < z[knee] / z.max() < 0.35
    shin = (np.abs(z - z[knee]) < 0.02) & (x > 0)
    assert y[knee] < np.quantile(y[shin], 0.2)  # in front


def test_a_landmark_without_a_vertex_is_named(tmp_path):
    bodies = replace(toy_bodies(), landmarks={"tail": 162})
    with pytest.raises(ConfigError, match="landmark tail: template point 162 has no vertex on toy0"):
        landmark_vertices(bodies, bodies.original.load("toy0"))


def test_the_original_comes_first_among_resolutions():
    assert list(toy_bodies().resolutions) == ["162 vertices", "300 vertices"]


def test_descriptors_come_from_the_store_the_second_time(tmp_path):
    store, mesh = toy_context(tmp_path).store, toy_bodies().original.load("toy0").mesh
    names = ("acd_isotropic", "acd_paper")
    first = describe(mesh, names, store)
    computed = store.computed
    for name, values in describe(mesh, names, store).items():
        np.testing.assert_array_equal(values, first[name])
        np.testing.assert_allclose(values, preset(name)(mesh).values, rtol=1e-5, atol=1e-4)
    assert store.computed == computed == 2


@pytest.mark.data
def test_faust_is_found_with_its_other_triangulations(data_set):
    root = data_set("FAUST_6890")
    bodies = faust_bodies(root)
    shape = bodies.original.load(bodies.body)
    right, up = shape.mesh.vertices[:, 0], shape.mesh.vertices[:, 1]
    at = landmark_vertices(bodies, shape)
    assert up[at["head"]] > up.min() + 0.97 * np.ptp(up)
    assert 0.2 < (up[at["left knee"]] - up.min()) / np.ptp(up) < 0.35
    assert right[at["left knee"]] > right[[at["head"]]]


@dataclass(frozen=True)
class OnAnotherTemplate(Toys):
    """The toys, whose points are counted on a template of 100 points."""

    def load(self, name):
        shape = super().load(name)
        return Shape(shape.mesh, PointMap.identity(100, shape.mesh.n_vertices))


def test_triangulations_over_another_template_do_not_correspond(caplog):
    others = {"same": Toys(n_vertices=300), "other": OnAnotherTemplate(n_vertices=300)}
    bodies = replace(toy_bodies(), others=others)
    assert list(bodies.corresponding) == ["same"]
    assert "its template has 100 points, not 162" in caplog.text
