"""What an evaluation gives: one row per pair of shapes, a pooled summary and the CQC curve."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from csm._types import FloatArray
from csm.evaluation import metrics
from csm.evaluation.distances import Lengths, MatchedPoints, PointErrors

if TYPE_CHECKING:
    from csm.evaluation.protocol import Protocol


@dataclass(frozen=True, eq=False)
class PairErrors:
    """Everything measured on one pair: the points, their errors, and the lengths to divide by."""

    pair: tuple[str, str]
    points: MatchedPoints
    errors: PointErrors
    lengths: Lengths


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
        Fraction of points that are left-right flips; None if the flipped truth is not known.
    coverage
        Number of different vertices that the points are matched to over that of different true vertices.
    unreachable
        Points matched to another component than the true vertex's.
    diameter, sqrt_area
        Of the target, in the unit of its mesh.
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


@dataclass(frozen=True, eq=False)
class Evaluation:
    """The result of `csm.evaluation.protocol.evaluate_matches`.

    Parameters
    ----------
    protocol
        What was asked.
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
    seconds
        Wall time of matching and measuring.
    """

    protocol: Protocol
    rows: tuple[PairRow, ...]
    errors: FloatArray
    thresholds: FloatArray
    cqc: FloatArray
    summary: Mapping[str, float]
    seconds: float

    def describe(self) -> str:
        """Return the caption: what was compared, how, and what came out."""
        s = self.summary
        return f"{self.protocol.describe(len(self.rows))} {int(s['points'])} points; AGE {s['age']:.5f}."


def summarise(measured: Sequence[PairErrors], protocol: Protocol, seconds: float) -> Evaluation:
    """Reduce the errors of all pairs to rows, curve and summary."""
    fractions = [m.errors.distance / float(getattr(m.lengths, protocol.normaliser)) for m in measured]
    rows = tuple(_row(m, f) for m, f in zip(measured, fractions, strict=True))
    errors = np.concatenate(fractions)
    curve = metrics.cqc(errors)
    return Evaluation(
        protocol, rows, errors, metrics.THRESHOLDS, curve, _summary(measured, rows, errors, curve), seconds
    )


def _row(measured: PairErrors, fractions: FloatArray) -> PairRow:
    points, errors = measured.points, measured.errors
    return PairRow(
        *measured.pair,
        points=len(fractions),
        age=metrics.average_geodesic_error(fractions),
        exact=metrics.exact_rate(points.matched, points.truth),
        p95=metrics.percentile95(fractions),
        flip=None if errors.flip is None else float(errors.flip.mean()),
        coverage=metrics.coverage(points.matched, points.truth),
        unreachable=errors.unreachable,
        diameter=measured.lengths.diameter,
        sqrt_area=measured.lengths.sqrt_area,
    )


def _summary(
    measured: Sequence[PairErrors], rows: Sequence[PairRow], errors: FloatArray, curve: FloatArray
) -> dict[str, float]:
    points = np.array([row.points for row in rows])

    def pooled(values: Sequence[float]) -> float:
        return float(np.average(np.array(values, dtype=np.float64), weights=points))

    flips = [m.errors.flip for m in measured if m.errors.flip is not None]
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
