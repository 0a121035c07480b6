"""From signals to a probability: logistic regressions that are fitted on pairs with known correspondence.

The two that csm uses are in ``csm/assets/calibration.json``, with the pairs they were fitted on; ``csm reproduce
confidence fit=true`` makes that file anew (`csm.reproduction.confidence`).
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any

import numpy as np
from scipy.special import expit

from csm._types import BoolArray, FloatArray
from csm.errors import DataError

_FLOOR = 0.02  # lengths and ratios are taken as logarithms above this
_AS_THEY_ARE = ("start", "start_all")
_RIDGE = 1e-3


@dataclass(frozen=True)
class Calibration:
    """A logistic regression of signals.

    Parameters
    ----------
    names
        Of the signals, in order.
    centre, scale, weights
        One number per signal: what its transformed value is shifted and divided by, and its weight.
    bias
        What is added.
    """

    names: tuple[str, ...]
    centre: tuple[float, ...]
    scale: tuple[float, ...]
    weights: tuple[float, ...]
    bias: float

    def probability(self, signals: FloatArray) -> FloatArray:
        """Return the probabilities, shape (N,), of rows of signals, (N, S)."""
        rows = (_transformed(signals, self.names) - np.array(self.centre)) / np.array(self.scale)
        found: FloatArray = expit(rows @ np.array(self.weights) + self.bias)
        return found


def fit_calibration(
    signals: FloatArray, right: BoolArray, names: Sequence[str], weights: FloatArray | None = None
) -> Calibration:
    """Fit a logistic regression with a small ridge, in which no evidence against a map speaks for it.

    Weights of agreement (start) are at least 0, those of all other signals at most 0, so that maps that are worse than
    all that it was fitted on are believed less, not more.

    Parameters
    ----------
    signals
        Shape (N, S).
    right
        Shape (N,): whether each match is near the truth.
    names
        Of the signals.
    weights
        Shape (N,): how much each row counts; None for all alike.

    Examples
    --------
    >>> x = np.linspace(0, 1, 100)[:, None]
    >>> found = fit_calibration(x, x[:, 0] < 0.3, ["back"])
    >>> bool(found.probability(x)[0] > 0.9 > 0.1 > found.probability(x)[-1])
    True
    """
    from scipy.optimize import minimize  # here, since it takes longer to import than a calibration to apply

    rows, y = _transformed(signals, tuple(names)), right.astype(np.float64)
    share = np.full(len(y), 1 / len(y)) if weights is None else weights / weights.sum()
    centre, scale = rows.mean(0), np.maximum(rows.std(0), 1e-9)
    design = np.hstack([np.ones((len(rows), 1)), (rows - centre) / scale])

    def loss(w: FloatArray) -> tuple[float, FloatArray]:
        z = design @ w
        ridge = np.concatenate([[0.0], w[1:]])
        value = float((share * (np.logaddexp(0, z) - y * z)).sum() + _RIDGE * (ridge**2).sum())
        return value, design.T @ (share * (expit(z) - y)) + 2 * _RIDGE * ridge

    bounds = [(None, None), *((0, None) if name in _AS_THEY_ARE else (None, 0) for name in names)]
    w = minimize(loss, np.zeros(design.shape[1]), jac=True, method="L-BFGS-B", bounds=bounds).x
    numbers = [tuple(float(value) for value in x) for x in (centre, scale, w[1:])]
    return Calibration(tuple(names), numbers[0], numbers[1], numbers[2], float(w[0]))


@cache
def calibration(kind: str) -> Calibration:
    """Return one of the calibrations that csm comes with.

    Parameters
    ----------
    kind
        "map" for the signals of any map, "refined" for those of refined ones.

    Raises
    ------
    DataError
        If the file is missing or damaged.
    """
    path = resources.files("csm") / "assets" / "calibration.json"
    try:
        return calibration_of(json.loads(path.read_text(encoding="utf-8"))[kind])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise DataError(f"csm/assets/calibration.json cannot be used ({error}); install the package again") from error


def calibration_of(record: Mapping[str, Any]) -> Calibration:
    """Return the calibration of a record as `dataclasses.asdict` makes it."""
    names, centre, scale, weights = (tuple(record[x]) for x in ("names", "centre", "scale", "weights"))
    return Calibration(names, centre, scale, weights, float(record["bias"]))


def _transformed(signals: FloatArray, names: tuple[str, ...]) -> FloatArray:
    plain = np.array([name in _AS_THEY_ARE for name in names])
    return np.where(plain, signals, np.log(np.maximum(signals, 0.0) + _FLOOR))
