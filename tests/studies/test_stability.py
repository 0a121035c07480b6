from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from csm.errors import DataError
from csm.studies import stability
from tests.studies.toys import Toys, toy_bodies, toy_context


def test_a_copy_of_the_mesh_changes_nothing(tmp_path):
    bodies = replace(toy_bodies(), others={"a copy": Toys()})
    found = stability.run(toy_context(tmp_path), source=bodies, descriptors=("acd_isotropic",), points=50)
    (row,) = found.rows
    assert (row["change"], row["contrast"], row["error"]) == (0, 0, 0)


def test_another_resolution_changes_a_little_and_is_told_for_each_descriptor(tmp_path):
    names = ("acd_isotropic", "acd_paper")
    found = stability.run(toy_context(tmp_path), source=toy_bodies(), descriptors=names, points=50, distance="edge")
    assert [(row["descriptor"], row["mesh"]) for row in found.rows] == [(name, "300 vertices") for name in names]
    for row in found.rows:
        assert 0 < row["change"] < 0.5
        assert 0 < row["contrast"] < 1
        assert 0 < row["error"] < 500
    assert found.pictures[0].is_file()


def test_without_a_triangulation_over_the_same_template_nothing_can_be_compared(tmp_path):
    with pytest.raises(DataError, match="toys has the same template"):
        stability.run(toy_context(tmp_path), source=replace(toy_bodies(), others={}))


def _constant(mesh, names, store):
    return {name: np.ones((mesh.n_vertices, 1), dtype=np.float32) for name in names}


def test_a_descriptor_that_is_the_same_everywhere_has_no_contrast(tmp_path, monkeypatch):
    monkeypatch.setattr(stability, "describe", _constant)
    (row,) = stability.run(toy_context(tmp_path), source=toy_bodies(), descriptors=("hks",), points=20).rows
    assert (row["change"], row["contrast"]) == (0, 1)
    assert row["error"] > 50
