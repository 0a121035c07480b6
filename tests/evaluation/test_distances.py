"""Errors of matches on one target: all points exactly, and some exactly with the others scaled."""

from __future__ import annotations

import numpy as np
import pytest

from csm.data.store import Store
from csm.errors import MeshError
from csm.evaluation.distances import STORED_POINTS, Lengths, MatchedPoints, PointErrors, target_errors
from csm.evaluation.metrics import FLIP_MARGIN
from csm.mesh.shape import Mesh
from csm.operators.geodesic import geodesics
from tests.shapes import blob, sphere

N = 162
EVERY = np.ones(N, dtype=bool)
MIRROR = np.arange(N)[::-1].copy()


@pytest.fixture(scope="module")
def target() -> Mesh:
    return blob(2)


def matches(group: str, seed: int, exact: np.ndarray = EVERY, mirror: np.ndarray | None = None) -> MatchedPoints:
    """Matches of which a fifth is right and the others are anywhere."""
    rng = np.random.default_rng(seed)
    matched = np.where(rng.random(N) < 0.2, np.arange(N), rng.integers(0, N, N))
    return MatchedPoints(np.arange(N), np.arange(N), matched, exact, mirror, group)


def some(n: int, seed: int = 3) -> np.ndarray:
    """Which n of the points are measured exactly."""
    return np.isin(np.arange(N), np.random.default_rng(seed).permutation(N)[:n])


@pytest.mark.parametrize("distance", ["exact", "edge", "heat"])
def test_all_points_have_the_distances_of_whole_rows(target, distance):
    asked = [matches("a", 0, mirror=MIRROR), matches("a", 2), matches("b", 1)]
    surface = geodesics(target, distance)
    rows = surface.rows(np.arange(N))
    found = target_errors(target, asked, distance, "diameter")
    assert found.lengths == Lengths(surface.diameter(), np.sqrt(target.area))
    for given, errors in zip(asked, found.errors, strict=True):
        np.testing.assert_allclose(errors.distance, rows[given.truth, given.matched], atol=1e-9)
        assert (errors.unreachable, errors.variance) == (0, 0.0)
    margin = FLIP_MARGIN * found.lengths.diameter
    away, from_mirror = (rows[a, asked[0].matched] for a in (np.arange(N), MIRROR))
    np.testing.assert_array_equal(found.errors[0].flip, from_mirror + margin < away)
    assert found.errors[0].flip.mean() > 0.2
    assert found.errors[1].flip is None


def test_the_other_points_are_edge_paths_scaled_to_the_exact_ones(target):
    exact = some(30)
    asked = [matches("a", 0, exact), matches("a", 2, exact), matches("b", 1, exact)]
    measured = target_errors(target, asked, "exact", "diameter")
    truth = [geodesics(target).pairs(m.truth, m.matched) for m in asked]
    along = [geodesics(target, "edge").pairs(m.truth, m.matched) for m in asked]
    ratio = {
        "a": (truth[0] + truth[1])[exact].sum() / (along[0] + along[1])[exact].sum(),
        "b": truth[2][exact].sum() / along[2][exact].sum(),
    }
    for m, t, a, errors in zip(asked, truth, along, measured.errors, strict=True):
        np.testing.assert_allclose(errors.distance[exact], t[exact])
        np.testing.assert_allclose(errors.distance[~exact], ratio[m.group] * a[~exact])
        residual = (t - ratio[m.group] * a)[exact]
        assert errors.variance == pytest.approx((residual**2).mean() / 30 * (1 - 30 / N))


def test_flips_are_told_of_the_points_measured_exactly(target):
    exact = some(60)
    (errors,) = target_errors(target, [matches("a", 0, exact, MIRROR)], "exact", "diameter").errors
    (every,) = target_errors(target, [matches("a", 0, mirror=MIRROR)], "exact", "diameter").errors
    assert errors.flip.shape == (60,)
    assert (errors.flip == every.flip[exact]).mean() > 0.95  # the distance to the mirrored truth is along edges


def test_the_mean_of_all_points_is_right_within_its_stated_error(target):
    deviations = []
    for seed in range(12):
        asked = matches("a", 0, some(40, seed))
        (errors,) = target_errors(target, [asked], "exact", "diameter").errors
        truth = geodesics(target).pairs(asked.truth, asked.matched).mean()
        assert errors.distance.mean() == pytest.approx(truth, rel=0.05)
        deviations.append((errors.distance.mean() - truth) / np.sqrt(errors.variance))
    assert 0.3 < np.std(deviations) < 2


def test_the_variance_falls_to_nothing_as_the_points_measured_exactly_become_all(target):
    variances = [
        target_errors(target, [matches("a", 0, some(n))], "exact", "diameter").errors[0].variance for n in (10, 80, 161)
    ]
    assert variances[0] > 5 * variances[1] > 50 * variances[2] > 0
    assert PointErrors(np.zeros(N), None, 0).variance == 0


def test_right_matches_have_no_error_and_need_no_ratio(target):
    right = MatchedPoints(np.arange(N), np.arange(N), np.arange(N), some(9))
    (errors,) = target_errors(target, [right], "exact", "diameter").errors
    assert errors.distance.max() == 0
    assert errors.variance == 0


@pytest.mark.parametrize("exact", [EVERY, np.arange(N) < 10], ids=["all", "some"])
def test_another_component_is_one_diameter_away(exact):
    one = sphere(2)
    both = Mesh(np.vstack([one.vertices, one.vertices + 5]), np.vstack([one.faces, one.faces + N]), "two")
    far = MatchedPoints(np.arange(N), np.arange(N), np.arange(N) + N, exact)
    measured = target_errors(both, [far], "exact", "diameter")
    assert measured.errors[0].unreachable == N
    np.testing.assert_allclose(measured.errors[0].distance, measured.lengths.diameter)


def test_an_error_beyond_the_estimated_diameter_bounds_what_is_unreachable(target):
    """The diameter is a lower bound, so a reachable point may be farther; an unreachable one is not nearer than it."""
    one = sphere(2)
    both = Mesh(np.vstack([one.vertices, one.vertices + 5]), np.vstack([one.faces, one.faces + N]), "two")
    truth = np.array([0, 1])
    far = geodesics(both, "edge").rows(truth[:1])[0]
    far[N:] = 0
    asked = MatchedPoints(truth, truth, np.array([far.argmax(), N + 3]), np.ones(2, dtype=bool))
    (errors,) = target_errors(both, [asked], "edge", "diameter").errors
    assert errors.distance[1] >= errors.distance[0]


def test_a_target_that_is_no_manifold_is_refused():
    fan = Mesh(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1.0]]), [[0, 1, 2], [0, 1, 3], [0, 1, 4]])
    one = MatchedPoints(np.array([0]), np.array([0]), np.array([2]), np.array([True]))
    with pytest.raises(MeshError, match="manifold"):
        target_errors(fan, [one], "exact", "diameter")


@pytest.mark.parametrize(("points", "stored"), [(STORED_POINTS, True), (STORED_POINTS + 1, False)])
def test_errors_are_the_same_with_a_store_and_many_points_keep_nothing(points, stored, tmp_path):
    mesh = blob(3)
    rng = np.random.default_rng(1)
    truth = rng.permutation(mesh.n_vertices)[:points]
    every = np.ones(points, dtype=bool)
    asked = [MatchedPoints(truth, truth, rng.integers(0, mesh.n_vertices, points), every) for _ in range(2)]
    plain = target_errors(mesh, asked, "edge", "diameter")
    store = Store(tmp_path)
    found = target_errors(mesh, asked, "edge", "diameter", store)
    for a, b in zip(plain.errors, found.errors, strict=True):
        np.testing.assert_allclose(a.distance, b.distance, rtol=2e-7)
    assert plain.lengths == found.lengths
    assert (store.computed > 0) == stored


def test_of_points_that_are_not_measured_exactly_no_row_is_stored(tmp_path):
    mesh, store = blob(3), Store(tmp_path)
    n = mesh.n_vertices
    rng = np.random.default_rng(0)
    asked = MatchedPoints(np.arange(n), np.arange(n), rng.integers(0, n, n), np.arange(n) < 5)
    target_errors(mesh, [asked], "exact", "diameter", store)
    assert 0 < store.computed <= 6  # and the diameter
