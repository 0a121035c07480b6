"""What an evaluation gives: one row per pair of shapes, a pooled summary and the CQC curve."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from csm._counts import counted
from csm._types import Arrays, FloatArray
from csm.evaluation import metrics
from csm.evaluation.distances import Lengths, MatchedPoints, PointErrors
from csm.evaluation.protocol import EvaluationProtocol


class Cell(NamedTuple):
    """What is measured together under one name: a perturbation of the targets, a method, a matcher."""

    perturbation: str
    method: str
    matcher: str


@dataclass(frozen=True, eq=False)
class PairErrors:
    """Everything measured on one pair: the points, their errors, the lengths to divide by, and what was left.

    `left` is the fraction of the target's vertices that a perturbation has left.
    """

    pair: tuple[str, str]
    points: MatchedPoints
    errors: PointErrors
    lengths: Lengths
    left: float = 1.0


@dataclass(frozen=True)
class PairRow:
    """One pair of shapes.

    Parameters
    ----------
    source, target
        Names.
    points
        Number of points averaged, P.
    age
        Mean error, a fraction of the protocol's normaliser.
    exact
        Fraction of points matched to the very true vertex.
    p95
        Error that 95 % of the points do not exceed.
    flip
        Fraction of the points measured exactly that are left-right flips; None if the flipped truth is not known.
    coverage
        Number of different vertices that the points are matched to over that of different true vertices.
    unreachable
        Points matched to another component than the true vertex's.
    diameter, sqrt_area
        Of the target, in the unit of its mesh.
    left
        Fraction of the target's vertices that a perturbation has left.
    """

    source: str
    target: str
    points: int
    age: float
    exact: float
    p95: float
    flip: float | None
    coverage: float
    unreachable: int
    diameter: float
    sqrt_area: float
    left: float = 1.0


@dataclass(frozen=True, eq=False)
class Evaluation:
    """What `csm.evaluation.engine.evaluate` found out about one method, matcher and perturbation.

    Parameters
    ----------
    method, matcher, perturbation
        Their names.
    protocol
        What was asked.
    pairs
        Everything that was measured, pair by pair, if it was asked for.
    rows
        One per pair, in the order of the protocol.
    errors
        Shape (P,), all points of all pairs, as fractions of the normaliser, in the order of `rows`.
    thresholds, cqc
        Shape (T,) each: the pooled curve.
    summary
        Pooled figures: ``age`` (over points), ``age_over_pairs`` (mean of the rows), ``age_diameter`` and
        ``age_sqrt_area`` (the pooled age in both normalisers), ``exact``, ``p95``, ``auc``, ``flip_rate`` (NaN if
        unknown), ``coverage`` (mean of the rows), ``pairs``, ``points``, ``unreachable``.
    uncertainty
        Standard error of the pooled age that is due to points that were not measured exactly.
    failures
        Shapes and targets that are left out -> why.
    seconds
        Wall time of matching and measuring everything that was asked for together.
    """

    method: str
    matcher: str
    perturbation: str
    protocol: EvaluationProtocol
    pairs: tuple[PairErrors, ...]
    rows: tuple[PairRow, ...]
    errors: FloatArray
    thresholds: FloatArray
    cqc: FloatArray
    summary: Mapping[str, float]
    uncertainty: float
    failures: Mapping[str, str]
    seconds: float

    def __repr__(self) -> str:
        error = f"{1000 * self.summary['age']:.1f} thousandths of the {self.protocol.normaliser}" if self.rows else "?"
        return f"Evaluation({self.method}, {self.matcher}: {error} over {counted(len(self.rows), 'pair')})"


def summarise(
    measured: Sequence[PairErrors],
    protocol: EvaluationProtocol,
    seconds: float,
    *,
    method: str,
    matcher: str = "nearest",
    perturbation: str = "",
    failures: Mapping[str, str] | None = None,
    keep_pairs: bool = False,
) -> Evaluation:
    """Reduce the errors of all pairs to rows, curve and summary; without any pair the summary is empty."""
    if not measured:
        nothing = np.zeros(0)
        return Evaluation(
            method, matcher, perturbation, protocol, (), (), nothing, nothing, nothing, {}, 0.0, failures or {}, seconds
        )
    divisors = np.array([float(getattr(m.lengths, protocol.normaliser)) for m in measured])
    fractions = [m.errors.distance / divisor for m, divisor in zip(measured, divisors, strict=True)]
    rows = tuple(_row(m, f) for m, f in zip(measured, fractions, strict=True))
    errors = np.concatenate(fractions)
    curve = metrics.cqc(errors)
    points = np.array([row.points for row in rows])
    variances = np.array([m.errors.variance for m in measured]) / divisors**2
    return Evaluation(
        method,
        matcher,
        perturbation,
        protocol,
        tuple(measured) if keep_pairs else (),
        rows,
        errors,
        metrics.THRESHOLDS,
        curve,
        _summary(measured, rows, errors, curve),
        float(np.sqrt((points**2 * variances).sum()) / points.sum()),
        dict(failures or {}),
        seconds,
    )


def _row(measured: PairErrors, fractions: FloatArray) -> PairRow:
    points, errors = measured.points, measured.errors
    return PairRow(
        *measured.pair,
        points=len(fractions),
        age=metrics.average_geodesic_error(fractions),
        exact=metrics.exact_rate(points.matched, points.truth),
        p95=metrics.percentile95(fractions),
        flip=None if errors.flip is None or errors.flip.size == 0 else float(errors.flip.mean()),
        coverage=metrics.coverage(points.matched, points.truth),
        unreachable=errors.unreachable,
        diameter=measured.lengths.diameter,
        sqrt_area=measured.lengths.sqrt_area,
        left=measured.left,
    )


def _summary(
    measured: Sequence[PairErrors], rows: Sequence[PairRow], errors: FloatArray, curve: FloatArray
) -> dict[str, float]:
    points = np.array([row.points for row in rows])

    def pooled(values: Sequence[float]) -> float:
        return float(np.average(np.array(values, dtype=np.float64), weights=points))

    flips = [m.errors.flip for m in measured if m.errors.flip is not None and m.errors.flip.size]
    totals = np.array([m.errors.distance.mean() for m in measured])
    return {
        "age": metrics.average_geodesic_error(errors),
        "age_over_pairs": float(np.mean([row.age for row in rows])),
        "age_diameter": pooled([t / row.diameter for t, row in zip(totals, rows, strict=True)]),
        "age_sqrt_area": pooled([t / row.sqrt_area for t, row in zip(totals, rows, strict=True)]),
        "exact": pooled([row.exact for row in rows]),
        "p95": metrics.percentile95(errors),
        "auc": metrics.auc(metrics.THRESHOLDS, curve),
        "flip_rate": float(np.concatenate(flips).mean()) if flips else float("nan"),
        "coverage": float(np.mean([row.coverage for row in rows])),
        "pairs": len(rows),
        "points": int(points.sum()),
        "unreachable": sum(row.unreachable for row in rows),
    }


def to_arrays(pairs: Sequence[PairErrors]) -> Arrays:
    """Return the measured pairs of one target as arrays for a store; `from_arrays` reads them."""
    flips = [p.errors.flip for p in pairs]
    return {
        "source": np.concatenate([p.points.source for p in pairs]).astype(np.int32),
        "truth": np.concatenate([p.points.truth for p in pairs]).astype(np.int32),
        "matched": np.concatenate([p.points.matched for p in pairs]).astype(np.int32),
        "exact": np.concatenate([p.points.exact for p in pairs]),
        "distance": np.concatenate([p.errors.distance for p in pairs]).astype(np.float32),
        "points": np.array([len(p.points.truth) for p in pairs]),
        "flip": np.concatenate([np.empty(0, dtype=bool) if flip is None else flip for flip in flips]),
        "flips": np.array([-1 if flip is None else len(flip) for flip in flips]),
        "unreachable": np.array([p.errors.unreachable for p in pairs]),
        "variance": np.array([p.errors.variance for p in pairs]),
        "lengths": np.array([pairs[0].lengths.diameter, pairs[0].lengths.sqrt_area]),
        "left": np.array(pairs[0].left),
    }


def from_arrays(a: Arrays, pairs: Sequence[tuple[str, str]]) -> list[PairErrors]:
    """Return the measured pairs that `to_arrays` made arrays of, with distances in single precision."""
    lengths = Lengths(*(float(x) for x in a["lengths"]))
    columns = ("source", "truth", "matched", "exact", "distance")
    parts = [np.split(a[name], np.cumsum(a["points"])[:-1]) for name in columns]
    flips = np.split(a["flip"], np.cumsum(np.maximum(a["flips"], 0))[:-1])
    found = []
    for i, (pair, source, truth, matched, exact, distance) in enumerate(zip(pairs, *parts, strict=True)):
        points = MatchedPoints(source.astype(np.int64), truth.astype(np.int64), matched.astype(np.int64), exact)
        flip = None if a["flips"][i] < 0 else flips[i]
        errors = PointErrors(distance.astype(np.float64), flip, int(a["unreachable"][i]), float(a["variance"][i]))
        found.append(PairErrors(pair, points, errors, lengths, float(a["left"])))
    return found
