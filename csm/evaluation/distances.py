"""How far matches on one target shape are from the truth; all sources, methods and matchers share the geodesic work.

With ``exact_points`` of the protocol only some points are measured exactly.  The exact distances that twelve
descriptors ask for on a target of 5000 vertices take a minute, although each true vertex is propagated from once for
all of them: descriptors of which some take left for right ask for far vertices from almost every point, so stopping
early saves little.  A shortest path along edges costs 1 ms, or 4 s for all.  It is 4 to 6 % too long, by much the same
factor everywhere: after scaling, what is left has a standard deviation of 0.003 to 0.013 of the diameter.  So all
points are measured along edges and scaled by the ratio of exact to edge distances where both are known, one ratio per
method and target (the ratio estimator of survey sampling, Cochran, "Sampling techniques", 1977, chapter 6);
`PointErrors.variance` says what that leaves uncertain.  On a pair of FAUST, means of 13 to 158 thousandths were off by
0.13 on average with 100 exact points, at a twelfth of the cost.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from csm._types import BoolArray, FloatArray, IntArray
from csm.errors import MeshError
from csm.evaluation.geodesic_rows import StoredGeodesics
from csm.evaluation.metrics import FLIP_MARGIN, flipped
from csm.mesh.shape import Mesh
from csm.operators import Memo
from csm.operators.geodesic import Geodesics, geodesics
from csm.operators.geodesic import Method as Distance

STORED_POINTS = 500
"""Rows of so many points are kept at most: at 15,000 vertices 30 MB per shape."""


@dataclass(frozen=True, eq=False)
class MatchedPoints:
    """P points of one source shape on the target, matched by one method.

    Parameters
    ----------
    source
        Shape (P,), vertices of the source.
    truth
        Shape (P,), the target vertices where the points belong.
    matched
        Shape (P,), the target vertices that they were matched to.
    exact
        Shape (P,), which of them are to be measured exactly.
    mirror
        Shape (P,), where they belong on the left-right flipped target, -1 if unknown; None if no flip is known.
    group
        What the points belong to, such as a method: those of one group share the scale of distances along edges.
    """

    source: IntArray
    truth: IntArray
    matched: IntArray
    exact: BoolArray
    mirror: IntArray | None = None
    group: Hashable = ""


@dataclass(frozen=True, eq=False)
class PointErrors:
    """Errors of P points, in units of `mesh.vertices`.

    Parameters
    ----------
    distance
        Shape (P,), from the true vertex to the matched one; the diameter where no path joins them.
    flip
        Whether the match is a left-right flip, for the points that are measured exactly; None if no flip is known.
    unreachable
        Number of points whose match no path joins to the truth.
    variance
        Of the mean distance, due to the points that are not measured exactly.
    """

    distance: FloatArray
    flip: BoolArray | None
    unreachable: int
    variance: float = 0.0


@dataclass(frozen=True)
class Lengths:
    """What errors on one shape may be divided by, in units of `mesh.vertices`."""

    diameter: float
    sqrt_area: float


@dataclass(frozen=True, eq=False)
class TargetErrors:
    """Errors of all matches on one target, in the order they were asked for."""

    lengths: Lengths
    errors: tuple[PointErrors, ...]


def target_errors(
    mesh: Mesh, matches: Sequence[MatchedPoints], distance: Distance, normaliser: str, memo: Memo | None = None
) -> TargetErrors:
    """Measure matches of several sources and methods on one target.

    Equal pairs of vertices, and points with the same true vertex, share their work.

    Parameters
    ----------
    mesh
        The target shape.
    matches
        What to measure.
    distance
        Kind of distance, also of the diameter.
    normaliser
        Field of `Lengths` that the margin of a flip (`metrics.FLIP_MARGIN`) is a fraction of.
    memo
        Where distances from the points are kept for the next question, if there are at most `STORED_POINTS` of them.

    Raises
    ------
    MeshError
        If the target is not a manifold, which exact distances need, or its diameter is not finite.
    """
    surface: Geodesics = geodesics(mesh, distance)
    measured = [m.exact for m in matches]
    if memo is not None and len(_unique([m.truth[m.exact] for m in matches])) <= STORED_POINTS:
        surface = StoredGeodesics(surface, mesh, memo)
    lengths = Lengths(surface.diameter(), float(np.sqrt(mesh.area)))
    if not np.isfinite(lengths.diameter):
        raise MeshError(f"{mesh.label}: its {distance} diameter is not finite, so errors have no unit; see csm check")
    margin = FLIP_MARGIN * float(getattr(lengths, normaliser))
    exact = _distances(surface, matches, measured)
    if all(where.all() for where in measured):
        along, flip_surface = exact, surface
        ratios: Mapping[Hashable, float] = {m.group: 1.0 for m in matches}
    else:
        flip_surface = geodesics(mesh, "edge")
        along = _distances(flip_surface, matches, [np.ones(len(where), dtype=bool) for where in measured])
        ratios = _ratios(matches, exact, along)
    scaled = [ratios[m.group] * a for m, a in zip(matches, along, strict=True)]
    flips = _flips(flip_surface, matches, scaled, ratios, margin)
    joined = zip(matches, exact, scaled, flips, strict=True)
    return TargetErrors(lengths, tuple(_joined(*parts, lengths.diameter) for parts in joined))


def _unique(parts: Sequence[IntArray]) -> IntArray:
    return np.unique(np.concatenate(parts)) if parts else np.empty(0, dtype=np.int64)


def _distances(surface: Geodesics, matches: Sequence[MatchedPoints], where: Sequence[BoolArray]) -> list[FloatArray]:
    """Return the distances from the true to the matched vertices, 0 elsewhere than at `where`."""
    missed = [w & (m.truth != m.matched) for m, w in zip(matches, where, strict=True)]
    return _between(surface, [m.truth for m in matches], [m.matched for m in matches], missed)


def _between(
    surface: Geodesics, starts: Sequence[IntArray], stops: Sequence[IntArray], where: Sequence[BoolArray]
) -> list[FloatArray]:
    first, second = np.concatenate(starts), np.concatenate(stops)
    return _at(where, lambda mask: surface.pairs(first[mask], second[mask]), float)


def _at(
    where: Sequence[BoolArray], ask: Callable[[BoolArray], NDArray[Any]], kind: type[float] | type[bool]
) -> list[NDArray[Any]]:
    """Ask about all points at `where` at once; return the answers in the parts of `where`, 0 elsewhere."""
    mask = np.concatenate(where)
    found = np.zeros(len(mask), dtype=kind)
    found[mask] = ask(mask)
    return np.split(found, np.cumsum([len(w) for w in where])[:-1])


def _ratios(
    matches: Sequence[MatchedPoints], exact: Sequence[FloatArray], along: Sequence[FloatArray]
) -> Mapping[Hashable, float]:
    """Return by group the sum of exact distances over that of edge paths, where both are known."""
    sums = {m.group: np.zeros(2) for m in matches}
    for m, e, a in zip(matches, exact, along, strict=True):
        both = m.exact & np.isfinite(a)
        sums[m.group] += e[both].sum(), a[both].sum()
    total = np.sum(list(sums.values()), axis=0)
    return {
        name: float(over[0] / over[1] if over[1] > 0 else total[0] / total[1] if total[1] > 0 else 1.0)
        for name, over in sums.items()
    }


def _flips(
    surface: Geodesics,
    matches: Sequence[MatchedPoints],
    scaled: Sequence[FloatArray],
    ratios: Mapping[Hashable, float],
    margin: float,
) -> list[BoolArray | None]:
    """Tell the left-right flips among the points measured exactly, where the miss is large enough for a flip."""
    mirrors = [np.full(len(m.truth), -1) if m.mirror is None else m.mirror for m in matches]
    far = [m.exact & (s > margin) & (mirror >= 0) for m, s, mirror in zip(matches, scaled, mirrors, strict=True)]
    if isinstance(surface, StoredGeodesics):  # which measures all points exactly, so that nothing is scaled
        starts, stops = np.concatenate(mirrors), np.concatenate([m.matched for m in matches])
        than = np.concatenate([s - margin for s in scaled])
        found = _at(far, lambda mask: surface.nearer(starts[mask], stops[mask], than[mask]), bool)
    else:
        distances = _between(surface, mirrors, [m.matched for m in matches], far)
        found = [
            where & flipped(s, ratios[m.group] * from_mirror, margin)
            for m, s, where, from_mirror in zip(matches, scaled, far, distances, strict=True)
        ]
    return [None if m.mirror is None else flip[m.exact] for m, flip in zip(matches, found, strict=True)]


def _joined(
    match: MatchedPoints, exact: FloatArray, scaled: FloatArray, flip: BoolArray | None, diameter: float
) -> PointErrors:
    distance = np.where(match.exact, exact, scaled)
    known = np.isfinite(distance)
    worst = max(diameter, float(distance[known].max(initial=0.0)))
    sampled = match.exact & known
    residual, n = exact[sampled] - scaled[sampled], int(match.exact.sum())
    spread = 0.0 if match.exact.all() or residual.size == 0 else float((residual**2).mean())
    variance = spread / max(n, 1) * (1 - n / len(distance))
    return PointErrors(np.minimum(distance, worst), flip, int((~known).sum()), variance)
