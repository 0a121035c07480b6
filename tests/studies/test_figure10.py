from __future__ import annotations

import numpy as np
import pytest
import torch

from csm.errors import ConfigError
from csm.studies.contestants import Contestant
from csm.studies.figure10 import NEAR, filled, run, vertex_errors
from tests.shapes import blob
from tests.studies.toys import toy_bodies, toy_context


def test_every_method_has_a_row_per_triangulation_and_a_picture(tmp_path):
    found = run(
        toy_context(tmp_path),
        source=toy_bodies(),
        descriptors=["acd_isotropic", "smwd"],
        distance="edge",
        size=(60, 80),
    )
    assert [(row["method"], row["mesh"]) for row in found.rows] == [
        ("ACD isotropic", "162 vertices"),
        ("ACD isotropic", "300 vertices"),
        ("SMWD", "162 vertices"),
        ("SMWD", "300 vertices"),
    ]
    assert found.pictures[0].is_file()
    with pytest.raises(ConfigError, match="high"):
        run(toy_context(tmp_path), source=toy_bodies(), high=0)


def test_errors_lie_at_the_vertices_that_were_matched():
    bodies = toy_bodies()
    here, there = (bodies.others["300 vertices"].load(name) for name in ("toy0", "toy1"))
    numbers = torch.arange(here.mesh.n_vertices)[:, None].float()
    right = Contestant("numbers", lambda mesh: numbers)
    wrong = Contestant("one", lambda mesh: torch.zeros_like(numbers))
    for values, exact in zip(vertex_errors(here, there, [right, wrong], "edge"), (162, 1), strict=True):
        assert np.isfinite(values[:162]).all()
        assert np.isnan(values[162:]).all()
        assert (values[:162] == 0).sum() == exact


def test_a_picture_takes_errors_over_to_near_vertices_only():
    mesh = blob(3).unit_area()
    values = np.full(mesh.n_vertices, np.nan)
    values[0] = 0.5
    distances = np.linalg.norm(mesh.vertices - mesh.vertices[0], axis=1)
    drawn = filled(mesh, values)
    assert (distances <= NEAR).sum() > 1
    np.testing.assert_array_equal(drawn[distances <= NEAR], 0.5)
    assert np.isnan(drawn[distances > NEAR]).all()
