"""Numbers that say how good a map is; plain functions of per-point errors.

An error is the geodesic distance from the true vertex to the matched one, as a fraction of a normaliser (the geodesic
diameter of the target, or the square root of its area).  P counts points, over one pair of shapes or pooled over many.
"""

from __future__ import annotations

import numpy as np

from csm._types import BoolArray, FloatArray, IntArray
from csm.errors import DataError

THRESHOLDS: FloatArray = np.linspace(0.0, 0.25, 251)
"""Where the CQC curve is sampled unless told otherwise: 0 to 0.25 in steps of 0.001."""

FLIP_MARGIN = 0.05
"""How much nearer (fraction of the normaliser) a match must be to the mirrored truth to count as a left-right flip."""

FAR = 0.1
"""Error (fraction of the normaliser) above which a match is a far miss: it is on another part of the body."""


def average_geodesic_error(errors: FloatArray) -> float:
    """Return the mean error (AGE) of P points, in the fraction that the errors are in.

    Examples
    --------
    >>> average_geodesic_error(np.array([0.0, 0.0, 0.03]))
    0.01
    """
    return float(_points(errors).mean())


def exact_rate(matched: IntArray, truth: IntArray) -> float:
    """Return the fraction of P points matched to the very ground-truth vertex.

    Examples
    --------
    >>> exact_rate(np.array([4, 7, 7, 1]), np.array([4, 7, 8, 1]))
    0.75
    """
    if matched.shape != truth.shape or matched.size == 0:
        raise DataError(f"{matched.shape} matches against {truth.shape} true vertices; wanted the same number, not 0")
    return float((matched == truth).mean())


def far_rate(errors: FloatArray) -> float:
    """Return the fraction of P points that are missed by more than `FAR`.

    Examples
    --------
    >>> far_rate(np.array([0.0, 0.1, 0.11, 0.5]))
    0.5
    """
    return float((_points(errors) > FAR).mean())


def percentile95(errors: FloatArray) -> float:
    """Return the error that 95 % of P points do not exceed (linear between order statistics).

    Examples
    --------
    >>> round(percentile95(np.linspace(0, 1, 101)), 4)
    0.95
    """
    return float(np.percentile(_points(errors), 95))


def cqc(errors: FloatArray, thresholds: FloatArray = THRESHOLDS) -> FloatArray:
    """Return the correspondence quality characteristic: the fraction of P points with an error of at most t.

    Source: Kim, Lipman, Funkhouser, *Blended intrinsic maps*, ACM TOG 30, 2011 (the Princeton protocol).

    Parameters
    ----------
    errors
        Shape (P,).
    thresholds
        Shape (T,).

    Returns
    -------
    FloatArray
        Shape (T,), between 0 and 1.

    Examples
    --------
    >>> cqc(np.array([0.0, 0.1, 0.1, 0.4]), np.array([0.0, 0.1, 0.2]))
    array([0.25, 0.75, 0.75])
    """
    return np.searchsorted(np.sort(_points(errors)), thresholds, side="right") / len(errors)


def auc(thresholds: FloatArray, curve: FloatArray) -> float:
    """Return the area under a CQC curve over the range of its thresholds: 1 if every error is 0, 0 if none is in range.

    By trapezoids, divided by the length of the range, so that a table must state the range beside it: 0..0.25 here by
    default, 0..0.1 in the functional-map papers.

    Examples
    --------
    >>> t = np.array([0.0, 0.1, 0.2])
    >>> round(auc(t, cqc(np.array([0.0, 0.0, 0.05, 9.0]), t)), 4)
    0.6875
    """
    span = float(thresholds[-1] - thresholds[0])
    return float(np.sum(0.5 * (curve[1:] + curve[:-1]) * np.diff(thresholds)) / span)


def flipped(errors: FloatArray, mirror_errors: FloatArray, margin: float = FLIP_MARGIN) -> BoolArray:
    """Tell which of P matches are left-right flips: nearer to the mirrored truth than to the truth, by the margin.

    With e the distance of the match from the truth and f from the mirrored truth, a flip has ``f + margin < e``.  By
    the triangle inequality this needs truth and mirrored truth more than `margin` apart, so points near the plane of
    symmetry, where a miss by one edge may cross it, are never flips.  Where f is NaN (mirror unknown) there is no flip.

    Examples
    --------
    >>> flipped(np.array([0.0, 0.5, 0.06, 0.5]), np.array([0.5, 0.02, 0.04, np.nan]))
    array([False,  True, False, False])
    """
    return mirror_errors + margin < errors


def coverage(matched: IntArray, truth: IntArray) -> float:
    """Return how many different vertices P points are matched to, over how many different ones they belong to.

    Examples
    --------
    >>> coverage(np.array([0, 0, 3, 3]), np.array([0, 1, 2, 3]))
    0.5
    """
    return len(np.unique(matched)) / len(np.unique(truth))


def _points(errors: FloatArray) -> FloatArray:
    if errors.ndim != 1 or errors.size == 0:
        raise DataError(f"errors have shape {errors.shape}, wanted (P,) with at least one point")
    return errors
