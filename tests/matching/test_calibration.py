from __future__ import annotations

import json
from dataclasses import asdict

import numpy as np
import pytest

from csm.matching.calibration import calibration, calibration_of, fit_calibration
from csm.matching.signals import OF_MAPS, OF_REFINED


def drawn(n: int = 4000) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Signals, the true probability that a match is right, and whether it is."""
    rng = np.random.default_rng(0)
    signals = np.stack([rng.random(n), rng.exponential(0.3, n)], axis=1)
    true = 1 / (1 + np.exp(-(-1.0 + 3 * signals[:, 0] - 2 * np.log(signals[:, 1] + 0.02))))
    return signals, true, rng.random(n) < true


def test_a_fit_finds_the_probability_that_rows_were_drawn_with():
    signals, true, right = drawn()
    found = fit_calibration(signals, right, ["start", "back"]).probability(signals)
    assert np.abs(found - true).mean() < 0.03


def test_weights_count_as_repetitions():
    signals, _, right = drawn(200)
    twice = fit_calibration(np.vstack([signals, signals[:50]]), np.r_[right, right[:50]], ["start", "back"])
    weights = np.where(np.arange(200) < 50, 2.0, 1.0)
    weighted = fit_calibration(signals, right, ["start", "back"], weights)
    np.testing.assert_allclose(weighted.probability(signals), twice.probability(signals), atol=0.01)


def test_a_record_of_plain_data_is_the_same_calibration():
    signals, _, right = drawn(200)
    found = fit_calibration(signals, right, ["start", "back"])
    assert calibration_of(json.loads(json.dumps(asdict(found)))) == found


@pytest.mark.parametrize(("kind", "names"), [("map", OF_MAPS), ("refined", (*OF_MAPS, *OF_REFINED))])
def test_the_shipped_calibrations_fit_the_signals(kind, names):
    found = calibration(kind)
    assert found.names == names
    assert all(scale > 0 for scale in found.scale)
