"""Each metric against its definition, point by point."""

from __future__ import annotations

import numpy as np
import pytest

from csm.errors import DataError
from csm.evaluation import metrics


@pytest.fixture
def errors() -> np.ndarray:
    return np.random.default_rng(0).gamma(1.0, 0.05, 1000) * (np.random.default_rng(1).random(1000) < 0.7)


def test_cqc_counts_points_within_each_threshold(errors: np.ndarray) -> None:
    curve = metrics.cqc(errors)
    expected = [(errors <= t).sum() / len(errors) for t in metrics.THRESHOLDS]
    np.testing.assert_allclose(curve, expected)
    assert metrics.THRESHOLDS[[0, -1]].tolist() == [0.0, 0.25]
    assert curve[0] == (errors == 0).mean()


def test_auc_is_one_for_a_perfect_map_and_falls_with_the_error(errors: np.ndarray) -> None:
    t = metrics.THRESHOLDS
    assert metrics.auc(t, metrics.cqc(np.zeros(5))) == 1.0
    assert metrics.auc(t, metrics.cqc(np.ones(5))) == 0.0
    clipped_mean = np.minimum(errors, 0.25).mean()
    assert metrics.auc(t, metrics.cqc(errors)) == pytest.approx(1 - clipped_mean / 0.25, abs=0.003)


def test_percentile_bounds_95_percent(errors: np.ndarray) -> None:
    assert np.mean(errors <= metrics.percentile95(errors)) == pytest.approx(0.95, abs=0.002)


def test_points_near_the_plane_of_symmetry_never_flip() -> None:
    rng = np.random.default_rng(0)
    truth, match = rng.uniform(-1, 1, (2, 500))
    e, f = np.abs(match - truth), np.abs(match + truth)
    flip = metrics.flipped(e, f, margin=0.1)
    np.testing.assert_array_equal(flip, e - f > 0.1)
    assert not flip[2 * np.abs(truth) <= 0.1].any()
    assert flip[(np.abs(truth) > 0.06) & (match == -truth)].all()
    assert metrics.flipped(np.abs(2 * truth), np.zeros(500), margin=0.1).sum() == (np.abs(truth) > 0.05).sum()


def test_nothing_to_average_is_an_error() -> None:
    for metric in (metrics.average_geodesic_error, metrics.percentile95, metrics.cqc):
        with pytest.raises(DataError, match="at least one point"):
            metric(np.empty(0))
    with pytest.raises(DataError, match="same number"):
        metrics.exact_rate(np.arange(3), np.arange(4))
