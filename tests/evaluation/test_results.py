"""What errors of pairs are reduced to, and how results of a target survive a store."""

from __future__ import annotations

import math

import numpy as np
import pytest

from csm.data.store import Store
from csm.evaluation import EvaluationProtocol
from csm.evaluation.distances import Lengths, MatchedPoints, PointErrors
from csm.evaluation.results import PairErrors, from_arrays, summarise, to_arrays
from tests.shapes import sphere


def pair(source: str, target: str, errors: list[float], flip: list[bool] | None = None, **options) -> PairErrors:
    """A pair whose points belong to the vertices 0, 1, ... of a target of diameter 2 and area 16."""
    n = len(errors)
    truth = np.arange(n)
    matched = np.where(np.array(errors) == 0, truth, truth + 1)
    exact = np.arange(n) < (n if flip is None else len(flip))
    points = MatchedPoints(truth + 5, truth, matched, exact)
    found = PointErrors(
        np.array(errors), None if flip is None else np.array(flip, dtype=bool), 0, options.pop("variance", 0.0)
    )
    return PairErrors((source, target), points, found, Lengths(2.0, 4.0), **options)


PAIRS = [
    pair("a", "b", [0.0, 0.2, 0.4, 0.6], [False, True, False], variance=0.04),
    pair("b", "a", [0.0, 1.0], variance=0.16, left=0.5),
]


def summary_of(pairs: list[PairErrors], protocol: EvaluationProtocol | None = None, **options):
    return summarise(pairs, protocol or EvaluationProtocol(), 1.5, method="m", **options)


def test_rows_and_summary_are_means_of_the_points():
    found = summary_of(PAIRS, matcher="argmax", perturbation="cut", failures={"x": "broken"})
    first, second = found.rows
    assert (first.points, first.age, first.exact, first.flip) == (4, pytest.approx(0.15), 0.25, pytest.approx(1 / 3))
    assert (first.coverage, first.unreachable, first.diameter, first.sqrt_area) == (1.0, 0, 2.0, 4.0)
    assert (second.age, second.flip, second.left, second.coverage) == (0.25, None, 0.5, 1.0)
    assert (first.p95, second.p95) == (pytest.approx(0.285), pytest.approx(0.475))
    np.testing.assert_allclose(found.errors, [0.0, 0.1, 0.2, 0.3, 0.0, 0.5])
    summary = found.summary
    assert summary["age"] == pytest.approx(1.1 / 6)
    assert summary["age_over_pairs"] == pytest.approx(0.2)
    assert summary["age_sqrt_area"] == pytest.approx(summary["age_diameter"] / 2) == pytest.approx(1.1 / 12)
    assert summary["exact"] == pytest.approx(2 / 6)
    assert summary["flip_rate"] == pytest.approx(1 / 3)
    assert (summary["pairs"], summary["points"], summary["unreachable"]) == (2, 6, 0)
    assert (found.method, found.matcher, found.perturbation) == ("m", "argmax", "cut")
    assert (found.failures, found.seconds, found.pairs) == ({"x": "broken"}, 1.5, ())
    assert repr(found) == "Evaluation(m, argmax: 183.3 thousandths of the diameter over 2 pairs)"


def test_the_uncertainty_is_that_of_the_mean_over_all_points():
    expected = math.sqrt(4**2 * 0.04 / 4 + 2**2 * 0.16 / 4) / 6
    assert summary_of(PAIRS).uncertainty == pytest.approx(expected)
    halved = summary_of(PAIRS, EvaluationProtocol(normaliser="sqrt_area"))
    assert halved.uncertainty == pytest.approx(expected / 2)


def test_pairs_are_kept_where_they_are_asked_for():
    assert summary_of(PAIRS, keep_pairs=True).pairs == tuple(PAIRS)


def test_flips_are_unknown_where_no_mirror_is_or_no_point_is_exact():
    assert math.isnan(summary_of([pair("a", "b", [0.1, 0.2])]).summary["flip_rate"])
    none = summary_of([pair("a", "b", [0.1, 0.2], [])])
    assert none.rows[0].flip is None
    assert math.isnan(none.summary["flip_rate"])


def test_without_a_pair_there_are_no_numbers():
    found = summary_of([], failures={"a": "why"})
    assert (found.rows, found.summary, found.errors.size, found.failures) == ((), {}, 0, {"a": "why"})
    assert repr(found) == "Evaluation(m, nearest: ? over 0 pairs)"


def test_results_of_a_target_survive_a_store(tmp_path):
    pairs = [
        pair("a", "t", [0.0, 0.25, 0.5], [True, False], variance=0.04, left=0.75),
        pair("b", "t", [0.5], left=0.75),
        pair("c", "t", [0.0, 0.125], [], left=0.75),
    ]
    Store(tmp_path).fetch("matched", sphere(1), {"a": 1}, lambda: to_arrays(pairs))
    kept = Store(tmp_path).read("matched", sphere(1), {"a": 1})
    again = from_arrays(kept, [p.pair for p in pairs])
    for one, other in zip(pairs, again, strict=True):
        assert (one.pair, one.lengths, one.left) == (other.pair, other.lengths, other.left)
        for name in ("source", "truth", "matched", "exact"):
            np.testing.assert_array_equal(getattr(one.points, name), getattr(other.points, name))
        np.testing.assert_array_equal(one.errors.distance, other.errors.distance)
        np.testing.assert_array_equal(one.errors.flip, other.errors.flip)
        assert (one.errors.unreachable, one.errors.variance) == (other.errors.unreachable, other.errors.variance)
    assert [p.errors.flip is None for p in again] == [False, True, False]
    assert summary_of(again).summary == pytest.approx(summary_of(pairs).summary)
