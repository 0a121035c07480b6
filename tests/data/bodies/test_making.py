from __future__ import annotations

import numpy as np
import pytest

from csm.data.bodies import making
from csm.data.bodies.archive import make_bodies
from csm.data.bodies.making import MOST_INTERSECTIONS, require_anny, standing
from csm.data.humans import load_humans
from csm.errors import ConfigError
from csm.mesh.check import check
from csm.mesh.intersections import intersecting_pairs
from tests.data_prep.anny import needs_anny


def test_a_missing_model_or_another_version_is_said_in_a_sentence(monkeypatch):
    def missing(_name):
        raise making.PackageNotFoundError

    monkeypatch.setattr(making, "version", missing)
    with pytest.raises(ConfigError, match=r'not installed: pip install "csm-correspondence\[prep\]"'):
        require_anny()
    monkeypatch.setattr(making, "version", lambda _name: "0.1")
    with pytest.raises(ConfigError, match=r"anny 0.6.2, here is 0.1"):
        require_anny()


def test_bodies_stand_on_the_ground():
    vertices = standing(np.random.default_rng(0).random((9, 3)))
    assert vertices[:, 2].min() == 0
    assert np.allclose(vertices[:, :2].min(axis=0) + vertices[:, :2].max(axis=0), 0)


@needs_anny
@pytest.mark.slow
def test_bodies_are_sound_different_and_do_not_depend_on_the_count(tmp_path):
    few, more = make_bodies(tmp_path / "a.npz", 2, 5), make_bodies(tmp_path / "b.npz", 4, 5)
    assert (few.load("b00001").mesh.vertices == more.load("b00001").mesh.vertices).all()
    faces = load_humans().faces
    shapes = [more.load(name).mesh for name in more.names]
    for mesh in shapes:
        assert not check(mesh)
        assert len(intersecting_pairs(mesh.vertices, faces)) <= MOST_INTERSECTIONS
        assert 0.9 < mesh.vertices[:, 2].max() < 2.8
    assert min(abs(a.vertices - b.vertices).max() for a in shapes for b in shapes if a is not b) > 0.1
