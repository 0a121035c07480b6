"""Descriptors made small enough for a page: a few bytes per vertex that keep the distances between vertices."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from csm._types import FloatArray
from csm.errors import ConfigError

UNKNOWN = -128
"""Code of every component of a vertex whose features are not finite."""

COMPONENTS = 16
_LARGEST = 127


@dataclass(frozen=True, eq=False)
class CompactFeatures:
    """Features of several shapes in few components of one byte each.

    The distance of two vertices with codes a and b is nearly ``norm(steps * (a - b))``.

    Parameters
    ----------
    codes
        Per shape (N, P), int8: P <= `COMPONENTS`; `UNKNOWN` where the features are not finite.
    steps
        Shape (P,): what a code of 1 stands for, in units of the features.
    kept
        Fraction of the variance over all shapes that is in the components.
    """

    codes: tuple[NDArray[np.int8], ...]
    steps: FloatArray
    kept: float


def compact_features(features: Sequence[ArrayLike], components: int = COMPONENTS) -> CompactFeatures:
    """Project the features of several shapes to their common principal components and round these to bytes.

    Parameters
    ----------
    features
        One or more arrays of shape (N, Q), the same Q for all, comparable by Euclidean distance.
    components
        How many to keep at most.

    Raises
    ------
    ConfigError
        If there are no features, or they are not matrices with the same number of columns.
    """
    rows = [np.asarray(f) for f in features]
    if not rows or any(f.ndim != 2 or f.shape[1:] != rows[0].shape[1:] or not f.shape[1] for f in rows):
        raise ConfigError(
            f"features have shapes {[f.shape for f in rows]}, wanted one row per vertex and the same number of columns "
            "for every shape; describe all shapes with one descriptor"
        )
    known = [np.asarray(np.isfinite(f).all(axis=1)) for f in rows]
    together = np.concatenate([f[k] for f, k in zip(rows, known, strict=True)], dtype=np.float64)
    if len(together):
        together -= together.mean(axis=0)
    kept, axes = _principal_axes(together, components)
    scores = together @ axes
    largest = np.abs(scores).max(axis=0, initial=0.0)
    steps = np.where(largest > 0, largest, 1.0) / _LARGEST
    found = np.full((sum(map(len, rows)), axes.shape[1]), UNKNOWN, dtype=np.int8)
    found[np.concatenate(known)] = np.rint(scores / steps)
    return CompactFeatures(tuple(np.split(found, np.cumsum([len(f) for f in rows])[:-1])), steps, kept)


def _principal_axes(centred: FloatArray, components: int) -> tuple[float, FloatArray]:
    """Return the fraction of the variance along the leading principal axes, and these as columns."""
    variances, axes = np.linalg.eigh(centred.T @ centred)
    leading = slice(-1, -min(components, len(variances)) - 1, -1)
    total = float(variances.clip(0).sum())
    return float(variances[leading].clip(0).sum()) / total if total > 0 else 1.0, axes[:, leading]
