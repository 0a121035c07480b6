"""Samples of a shape, against their definitions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.distance import cdist, pdist

from csm.matching.embedded import CROSSED, MOST, Embedded, farthest_points, n_eigenfunctions
from csm.matching.orientation import spectral_turns
from csm.mesh.debris import unit_area
from csm.mesh.shape import Mesh
from tests.matching.pairs import spectrum_of
from tests.shapes import blob, sphere


@pytest.fixture(scope="module")
def embedded() -> Embedded:
    mesh = unit_area(blob(2))
    return Embedded(mesh, spectrum_of(mesh, 25))


@given(st.integers(0, 1000), st.integers(3, 30), st.integers(1, 40))  # of two points both are as far from the mean
def test_each_point_is_the_farthest_from_those_before_it(seed, n_points, n):
    points = np.random.default_rng(seed).normal(size=(n_points, 3))
    chosen = farthest_points(points, n)
    n = min(n, n_points)
    assert len(set(chosen.tolist())) == len(chosen) == n
    np.testing.assert_array_equal(farthest_points(points, max(1, n - 1)), chosen[: max(1, n - 1)])
    assert chosen[0] == np.linalg.norm(points - points.mean(0), axis=1).argmax()
    distances = cdist(points, points)
    for i in range(1, n):
        assert chosen[i] == distances[:, chosen[:i]].min(1).argmax()


def test_they_cover_as_finely_as_they_lie_apart():
    points = blob(3).vertices
    chosen = farthest_points(points, 60)
    assert cdist(points, points[chosen]).min(1).max() <= pdist(points[chosen]).min()


def test_samples_share_out_the_area_and_hold_rows_of_the_whole(embedded):
    samples = embedded.samples(40)
    assert len(samples) == 40
    assert samples is embedded.samples(40), "they are chosen once"
    nearest = cdist(embedded.mesh.vertices, embedded.mesh.vertices[samples.at]).argmin(1)
    areas = [embedded.spectrum.mass[nearest == i].sum() for i in range(40)]
    np.testing.assert_allclose(samples.areas, areas, rtol=1e-5)
    assert float(samples.areas.sum()) == pytest.approx(1, rel=1e-5)
    np.testing.assert_allclose(samples.evecs, embedded.spectrum.evecs[samples.at], rtol=1e-5, atol=1e-6)
    turns = spectral_turns(embedded.mesh, embedded.spectrum, CROSSED, 25)
    np.testing.assert_allclose(samples.turns, turns[samples.at], rtol=1e-4, atol=1e-4 * np.abs(turns).max())


def test_no_more_samples_than_vertices(embedded):
    samples = embedded.samples(10**6)
    np.testing.assert_array_equal(np.sort(samples.at), np.arange(embedded.mesh.n_vertices))
    np.testing.assert_allclose(samples.areas, embedded.areas[samples.at], rtol=1e-6)


def test_coincident_points_are_each_chosen_once():
    points = np.repeat(np.random.default_rng(0).normal(size=(5, 3)), 3, axis=0)
    assert sorted(farthest_points(points, 15).tolist()) == list(range(15))


def test_a_vertex_without_area_is_no_sample():
    mesh = blob(1)
    spectrum = spectrum_of(mesh, 10)
    lonely = Mesh(np.concatenate([mesh.vertices, [[9.0, 9, 9]]]), mesh.faces)
    padded = replace(
        spectrum, evecs=np.concatenate([spectrum.evecs, np.zeros((1, 10))]), mass=np.append(spectrum.mass, 0.0)
    )
    for n in (5, 100):
        assert mesh.n_vertices not in Embedded(lonely, padded).samples(n).at


def test_tensors_are_single_precision_copies_of_the_spectrum(embedded):
    assert embedded.k == 25
    assert {str(t.dtype) for t in (embedded.evecs, embedded.evals, embedded.areas)} == {"torch.float32"}
    np.testing.assert_allclose(embedded.evals, embedded.spectrum.evals, rtol=1e-6)
    assert Embedded(embedded.mesh, embedded.spectrum, "meta").evecs.device.type == "meta"


def test_small_meshes_have_fewer_eigenfunctions():
    assert n_eigenfunctions(sphere(0)) == CROSSED + 2
    assert n_eigenfunctions(sphere(2)) == 162 // 5
    assert n_eigenfunctions(sphere(4)) == MOST
    tetrahedron = Mesh(np.eye(4)[:, :3], np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]))
    assert n_eigenfunctions(tetrahedron) == 4
