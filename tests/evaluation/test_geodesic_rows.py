"""Kept rows give the same distances, and are kept where they save work."""

from __future__ import annotations

import numpy as np
import pytest

from csm.data.store import Store
from csm.evaluation.geodesic_rows import FAR, StoredGeodesics
from csm.mesh.shape import Mesh
from csm.operators.geodesic import geodesics
from tests.shapes import blob


@pytest.fixture
def mesh() -> Mesh:
    return blob(2)


class Counting:
    """Distances that count the vertices that are propagated from."""

    def __init__(self, surface) -> None:
        self.surface, self.method, self.pairs_measured = surface, surface.method, 0

    def rows(self, sources):
        return self.surface.rows(sources)

    def pairs(self, sources, targets):
        self.pairs_measured += len(sources)
        return self.surface.pairs(sources, targets)


def pairs(mesh: Mesh, n: int = 40) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    return rng.integers(0, 9, n), rng.integers(0, mesh.n_vertices, n)


@pytest.mark.parametrize("method", ["exact", "edge", "heat"])
def test_distances_are_those_of_the_surface_when_made_and_when_read(mesh, method, tmp_path):
    sources, targets = pairs(mesh)
    surface = geodesics(mesh, method)
    expected = surface.pairs(sources, targets)
    for _ in range(2):
        kept = StoredGeodesics(geodesics(mesh, method), mesh, Store(tmp_path))
        np.testing.assert_allclose(kept.pairs(sources, targets), expected, rtol=2e-7, atol=1e-12)
        np.testing.assert_allclose(kept.rows(sources[:2]), surface.rows(sources[:2]), rtol=2e-7, atol=1e-12)
        assert kept.diameter() == surface.diameter()
        assert kept.method == method


def test_far_pairs_make_rows_once_and_near_ones_none(mesh, tmp_path):
    sources, targets = pairs(mesh)
    straight = np.linalg.norm(mesh.vertices[sources] - mesh.vertices[targets], axis=1)
    far = straight > FAR * np.sqrt(mesh.area)
    store = Store(tmp_path)
    kept = StoredGeodesics(geodesics(mesh, "edge"), mesh, store)
    kept.pairs(sources[~far], targets[~far])
    assert (~far).any()
    assert store.computed == 0
    kept.pairs(sources, targets)
    kept.pairs(sources, targets)
    assert store.computed == len(np.unique(sources[far])) == len(list(tmp_path.glob("geodesic-row/*.npz")))


def test_what_no_path_joins_stays_infinitely_far(tmp_path):
    one = blob(1)
    two = Mesh(
        np.concatenate([one.vertices, one.vertices + 9]), np.concatenate([one.faces, one.faces + one.n_vertices])
    )
    kept = StoredGeodesics(geodesics(two), two, Store(tmp_path))
    assert kept.pairs(np.array([0]), np.array([one.n_vertices])) == np.inf


def test_which_pairs_are_nearer_is_mostly_told_from_known_rows(tmp_path):
    mesh, rng = blob(3), np.random.default_rng(0)
    surface, asked = Counting(geodesics(mesh, "exact")), rng.integers(0, mesh.n_vertices, (2, 300))
    kept = StoredGeodesics(surface, mesh, Store(tmp_path))
    distances = geodesics(mesh, "exact").pairs(*asked)
    than = distances + rng.choice([-1, 1], 300) * rng.uniform(0.01, 0.5, 300)
    np.testing.assert_array_equal(kept.nearer(*asked, than), distances < than)  # nothing is known yet
    measured = surface.pairs_measured
    kept.rows(rng.integers(0, mesh.n_vertices, 60))
    np.testing.assert_array_equal(kept.nearer(*asked, than), distances < than)
    assert surface.pairs_measured - measured < 0.3 * measured


def test_a_pair_on_two_components_is_never_nearer(tmp_path):
    one = blob(1)
    two = Mesh(
        np.concatenate([one.vertices, one.vertices + 9]), np.concatenate([one.faces, one.faces + one.n_vertices])
    )
    kept = StoredGeodesics(geodesics(two), two, Store(tmp_path))
    for _ in range(2):  # without and with known rows
        there = np.array([0, one.n_vertices])
        assert kept.nearer(np.array([1, 1]), there, np.array([99.0, 99.0])).tolist() == [True, False]
        kept.rows(np.array([3, one.n_vertices + 3]))


def test_heat_distances_which_are_not_symmetric_are_measured(tmp_path):
    mesh, rng = blob(3), np.random.default_rng(1)
    asked, surface = rng.integers(0, mesh.n_vertices, (2, 200)), geodesics(mesh, "heat")
    kept = StoredGeodesics(surface, mesh, Store(tmp_path))
    kept.rows(np.arange(0, mesh.n_vertices, 20))
    distances = surface.pairs(*asked)
    than = distances * rng.choice([0.99, 1.01], 200)
    np.testing.assert_array_equal(kept.nearer(*asked, than), distances < than)
