from __future__ import annotations

import numpy as np
import pytest

from csm.data.humansset import HumansSet
from csm.errors import ConfigError

NAME = "s03_p04"


@pytest.fixture(scope="module")
def store(tmp_path_factory) -> str:
    return str(tmp_path_factory.mktemp("store"))


def test_the_original_is_its_own_truth():
    shape = HumansSet.parse("original").load(NAME)
    np.testing.assert_array_equal(shape.truth.indices, np.arange(shape.mesh.n_vertices))


def test_refined_keeps_the_original_vertices_first(store):
    original = HumansSet().load(NAME).mesh
    refined = HumansSet.parse(f"refined_{original.n_vertices + 300}", store).load(NAME)
    assert refined.mesh.n_vertices == original.n_vertices + 300
    np.testing.assert_allclose(refined.mesh.vertices[refined.truth.indices], original.vertices)


def test_remeshed_has_other_vertices_close_to_those_they_stand_for(store):
    original = HumansSet().load(NAME).mesh
    other = HumansSet.parse("remeshed_2000", store).load(NAME)
    assert other.mesh.n_vertices == pytest.approx(2000, rel=0.02)
    off = np.linalg.norm(other.mesh.vertices[other.truth.indices] - original.vertices, axis=1)
    edge = np.sqrt(other.mesh.area / other.mesh.n_faces) * 1.5
    assert np.median(off) < edge / 2
    assert 0 < off.max() < 3 * edge


def test_the_mirror_is_the_truth_after_the_flip_of_the_template(store):
    flip = HumansSet().load(NAME).mirror.indices
    other = HumansSet.parse("remeshed_2000", store).load(NAME)
    np.testing.assert_array_equal(other.mirror.indices, other.truth.indices[flip])


def test_a_variant_is_made_once(store, monkeypatch):
    wanted = HumansSet.parse("remeshed_2000", store)
    first = wanted.load(NAME)
    monkeypatch.setattr("csm.data.humansset.remesh", None)
    assert wanted.load(NAME).mesh.digest == first.mesh.digest


@pytest.mark.parametrize("text", ["", "originals", "original_5", "refined", "refined_many", "remeshed_-3"])
def test_other_names_are_refused(text):
    with pytest.raises(ConfigError, match="wanted original, refined_N or remeshed_N"):
        HumansSet.parse(text)
