from __future__ import annotations

import numpy as np
import pytest

from csm.data.shapeset import Shape
from csm.errors import MeshError
from csm.evaluation.distances import MatchedPoints, PointErrors, target_errors
from csm.mesh.correspondence import PointMap
from csm.mesh.shape import Mesh
from csm.operators.geodesic import geodesics
from csm.studies.measure import Errors, Question, chosen_points, errors_on_target
from tests.shapes import blob, sphere

N = 162


@pytest.fixture(scope="module")
def target() -> Shape:
    return Shape(blob(2), PointMap.identity(N))


def question(name: str, seed: int, exact: np.ndarray, mirror: np.ndarray | None = None) -> Question:
    """Matches of which a fifth is right and the others are anywhere."""
    rng = np.random.default_rng(seed)
    matched = np.where(rng.random(N) < 0.2, np.arange(N), rng.integers(0, N, N))
    return Question(name, MatchedPoints(np.arange(N), matched, mirror), exact)


def every() -> np.ndarray:
    return np.ones(N, dtype=bool)


def test_all_points_exactly_are_what_the_evaluation_measures(target):
    mirror = np.arange(N)[::-1].copy()
    asked = [question("a", 0, every(), mirror), question("b", 1, every())]
    measured = errors_on_target(target, asked, "diameter")
    wanted = target_errors(target.mesh, "exact", "diameter", [q.points for q in asked])
    assert measured.lengths == wanted.lengths
    for mine, other in zip(measured.errors, wanted.errors, strict=True):
        np.testing.assert_allclose(mine.points.distance, other.distance)
        assert (mine.residual, mine.variance()) == (0, 0)
    flips, others = measured.errors[0].points.flip, wanted.errors[0].flip
    assert measured.errors[1].points.flip is None
    assert others.mean() > 0.2
    assert (flips == others).mean() > 0.97  # the distance to the mirrored truth is along edges


def test_the_other_points_are_edge_paths_scaled_to_the_exact_ones(target):
    exact = chosen_points(target.truth, target.truth, 30, seed=3)
    asked = [question("a", 0, exact), question("a", 2, exact), question("b", 1, exact)]
    measured = errors_on_target(target, asked, "diameter")
    truth = [geodesics(target.mesh).pairs(q.points.truth, q.points.matched) for q in asked]
    along = [geodesics(target.mesh, "edge").pairs(q.points.truth, q.points.matched) for q in asked]
    ratio = {
        "a": (truth[0] + truth[1])[exact].sum() / (along[0] + along[1])[exact].sum(),
        "b": truth[2][exact].sum() / along[2][exact].sum(),
    }
    for q, t, a, errors in zip(asked, truth, along, measured.errors, strict=True):
        np.testing.assert_allclose(errors.points.distance[exact], t[exact])
        np.testing.assert_allclose(errors.points.distance[~exact], ratio[q.descriptor] * a[~exact])
        assert errors.n_exact == 30


def test_the_mean_of_all_points_is_right_within_its_stated_error(target):
    deviations = []
    for seed in range(12):
        exact = chosen_points(target.truth, target.truth, 40, seed)
        asked = question("a", 0, exact)
        (errors,) = errors_on_target(target, [asked], "diameter").errors
        truth = geodesics(target.mesh).pairs(asked.points.truth, asked.points.matched).mean()
        assert errors.points.distance.mean() == pytest.approx(truth, rel=0.05)
        deviations.append((errors.points.distance.mean() - truth) / np.sqrt(errors.variance()))
    assert 0.3 < np.std(deviations) < 2


def test_the_variance_falls_to_nothing_as_the_points_measured_exactly_become_all():
    points = PointErrors(np.zeros(N), None, 0)
    few, many = (Errors(points, 0.1, n).variance() for n in (2, 160))
    assert few == pytest.approx(0.005, rel=0.02)
    assert many < few / 1000


def test_right_matches_have_no_error_and_need_no_ratio(target):
    right = Question("a", MatchedPoints(np.arange(N), np.arange(N)), chosen_points(target.truth, target.truth, 9, 0))
    (errors,) = errors_on_target(target, [right], "diameter").errors
    assert errors.points.distance.max() == 0
    assert errors.variance() == 0


def test_another_component_is_one_diameter_away():
    one, n = sphere(2), 162
    both = Mesh(np.vstack([one.vertices, one.vertices + 5]), np.vstack([one.faces, one.faces + n]), "two")
    far = MatchedPoints(np.arange(n), np.arange(n) + n)
    exact = np.arange(n) < 10
    measured = errors_on_target(Shape(both, PointMap.identity(2 * n)), [Question("a", far, exact)], "diameter")
    assert measured.errors[0].points.unreachable == n
    np.testing.assert_allclose(measured.errors[0].points.distance, measured.lengths.diameter)


def test_the_drawn_template_points_are_the_same_in_every_pair():
    known = np.arange(N)
    known[::3] = -1
    whole, part = PointMap.identity(N), PointMap(known, PointMap.identity(1).direction, N)
    alone, both = chosen_points(whole, whole, 50, 1), chosen_points(part, whole, 50, 1)
    assert alone.sum() == 50
    np.testing.assert_array_equal(both, alone[known >= 0])
    assert chosen_points(whole, part, 50, 1).sum() == 50
    assert chosen_points(part, whole, None, 1).all()


def test_a_target_that_is_no_manifold_is_refused():
    fan = Mesh(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1.0]]), [[0, 1, 2], [0, 1, 3], [0, 1, 4]])
    question = Question("a", MatchedPoints(np.array([0]), np.array([2])), np.array([True]))
    with pytest.raises(MeshError, match="manifold"):
        errors_on_target(Shape(fan, PointMap.identity(5)), [question], "diameter")
