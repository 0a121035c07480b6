from __future__ import annotations

import numpy as np
import pytest

from csm.errors import ConfigError, MeshError
from csm.studies import figure13
from csm.studies.figure13 import cut_extremity, run
from tests.shapes import blob
from tests.studies.toys import toy_bodies, toy_context

SMALL = {"descriptors": ["acd_isotropic"], "n_pairs": 2, "points": 40, "distance": "edge", "fractions": [0.2]}


def test_every_damage_has_its_row_and_what_it_leaves(tmp_path, monkeypatch):
    monkeypatch.setattr(figure13, "grown_together", _too_round)
    found = run(toy_context(tmp_path), source=toy_bodies(), **SMALL)
    (line,) = found.rows
    none, cut, grown = line["cells"]
    assert found.columns == ("method", "none", "20 % cut away", "grown together")
    assert "grown together" not in line
    assert (none["vertices left"], none["damage"]) == (1, "none")
    assert 0.6 < cut["vertices left"] < 0.95
    assert cut["error"] > none["error"]
    assert (grown["error"], grown["failed"]) == (None, "nothing touches")
    assert "ACD isotropic, grown together: nothing touches" in found.notes
    assert found.pictures[0].is_file()


def _too_round(mesh):
    raise MeshError("nothing touches")


def test_the_extremity_is_what_is_farthest_from_the_middle():
    mesh = blob(3)
    left = cut_extremity(mesh, 0.1)
    gone = np.setdiff1d(np.arange(mesh.n_vertices), left.kept)
    middle = mesh.face_areas @ mesh.corners.mean(axis=1) / mesh.area
    assert np.linalg.norm(mesh.vertices - middle, axis=1).argmax() in gone


@pytest.mark.parametrize("wrong", [{"fractions": [0.0]}, {"fractions": [1.0]}, {"descriptors": []}, {"points": 0}])
def test_wrong_options_are_refused(tmp_path, wrong):
    with pytest.raises(ConfigError):
        run(toy_context(tmp_path), source=toy_bodies(), **(SMALL | wrong))
