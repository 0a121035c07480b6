"""How far matches on one target shape are from the truth; geodesic work is shared between all its source shapes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from csm._types import BoolArray, FloatArray, IntArray
from csm.evaluation.metrics import FLIP_MARGIN, flipped
from csm.evaluation.remembered import RememberedGeodesics
from csm.mesh.shape import Mesh
from csm.operators.geodesic import Geodesics, Method, geodesics
from csm.operators.operators import Memo

KEPT_POINTS = 500
"""Rows of so many points are kept at most: at 15,000 vertices 30 MB per shape."""


@dataclass(frozen=True, eq=False)
class MatchedPoints:
    """P points of one source shape on the target.

    Parameters
    ----------
    truth
        Shape (P,), the target vertices where the points belong.
    matched
        Shape (P,), the target vertices that they were matched to.
    mirror
        Shape (P,), where they belong on the left-right flipped target, -1 if unknown; None if no flip is known.
    """

    truth: IntArray
    matched: IntArray
    mirror: IntArray | None = None


@dataclass(frozen=True, eq=False)
class PointErrors:
    """Errors of P points, in units of `mesh.vertices`.

    Parameters
    ----------
    distance
        Shape (P,), from the true vertex to the matched one; the diameter where no path joins them.
    flip
        Shape (P,), whether the match is a left-right flip; None if no flip is known.
    unreachable
        Number of points whose match no path joins to the truth.
    """

    distance: FloatArray
    flip: BoolArray | None
    unreachable: int


@dataclass(frozen=True)
class Lengths:
    """What errors on one shape may be divided by, in units of `mesh.vertices`."""

    diameter: float
    sqrt_area: float


@dataclass(frozen=True, eq=False)
class TargetErrors:
    """Errors of all source shapes on one target, in the order they were asked for."""

    lengths: Lengths
    errors: tuple[PointErrors, ...]


def target_errors(
    mesh: Mesh, method: Method, normaliser: str, sources: Sequence[MatchedPoints], memo: Memo | None = None
) -> TargetErrors:
    """Measure the matches of several source shapes on one target.

    Only pairs of vertices that were missed are measured, from the true vertex to the matched one, each pair once.

    Parameters
    ----------
    mesh
        The target shape.
    method
        Kind of distance, also of the diameter.
    normaliser
        Field of `Lengths` that the margin of a flip (`metrics.FLIP_MARGIN`) is a fraction of.
    sources
        Matches of each source shape.
    memo
        Where distances from the points are kept for the next question, if there are at most `KEPT_POINTS` of them.
    """
    surface: Geodesics = geodesics(mesh, method)
    if memo is not None and len(np.unique(np.concatenate([p.truth for p in sources]))) <= KEPT_POINTS:
        surface = RememberedGeodesics(surface, mesh, memo)
    lengths = Lengths(surface.diameter(), float(np.sqrt(mesh.area)))
    margin = FLIP_MARGIN * float(getattr(lengths, normaliser))
    missed = [p.truth != p.matched for p in sources]
    found = _distances(
        surface,
        [(p.truth[m], p.matched[m]) for p, m in zip(sources, missed, strict=True)],
    )
    distances = [_spread(m, d) for m, d in zip(missed, found, strict=True)]
    flips = _flips(surface, sources, distances, margin)
    return TargetErrors(
        lengths,
        tuple(
            PointErrors(np.minimum(d, max(lengths.diameter, _largest(d))), flip, int(np.isinf(d).sum()))
            for d, flip in zip(distances, flips, strict=True)
        ),
    )


def _distances(surface: Geodesics, questions: Sequence[tuple[IntArray, IntArray]]) -> list[FloatArray]:
    ends = np.cumsum([len(a) for a, _ in questions])[:-1]
    starts, stops = (np.concatenate([q[side] for q in questions]) for side in (0, 1))
    return np.split(surface.pairs(starts, stops), ends)


def _spread(where: BoolArray, values: FloatArray) -> FloatArray:
    out = np.zeros(len(where))
    out[where] = values
    return out


def _largest(distances: FloatArray) -> float:
    return float(distances[np.isfinite(distances)].max(initial=0.0))


def _flips(
    surface: Geodesics, sources: Sequence[MatchedPoints], distances: Sequence[FloatArray], margin: float
) -> list[BoolArray | None]:
    """Measure the distance from the mirrored truth where the miss is large enough for a flip."""
    mirrors = [np.full(len(p.truth), -1) if p.mirror is None else p.mirror for p in sources]
    far = [(d > margin) & (mirror >= 0) for d, mirror in zip(distances, mirrors, strict=True)]
    found = _distances(surface, [(m[f], p.matched[f]) for p, m, f in zip(sources, mirrors, far, strict=True)])
    flips: list[BoolArray | None] = []
    for points, distance, where, from_mirror in zip(sources, distances, far, found, strict=True):
        flip = np.zeros(len(distance), dtype=bool)
        flip[where] = flipped(distance[where], from_mirror, margin)
        flips.append(None if points.mirror is None else flip)
    return flips
