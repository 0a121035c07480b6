"""How far to believe a map, vertex by vertex: a probability from evidence that needs no ground truth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from csm._counts import counted
from csm._types import FloatArray, IntArray
from csm.matching.base import Described
from csm.matching.calibration import Calibration, calibration
from csm.matching.maps import VertexMap
from csm.matching.nearest import nearest
from csm.matching.signals import NEAR, OF_MAPS, SAMPLES, Sides, map_signals, spectral_signals
from csm.mesh.debris import body_of
from csm.mesh.shape import Mesh

if TYPE_CHECKING:
    from torch import Tensor

TRUSTED = 0.5
"""Confidence from which a partner counts as trustworthy: it is more probably right than not."""

AMBIGUOUS = (
    "the shapes look the same in several ways, such as turned or mirrored, and the map is one of several equally good "
    "ones"
)
"""What is added to the verdict on symmetric shapes."""

STRAINED = (
    "WARNING: even the best map that was found keeps areas, lengths and the descriptor badly, so it is probably wrong "
    "whatever its confidence says; csm check may tell what is odd about the meshes"
)
"""What is added to the verdict where a search found nothing that fits."""


@dataclass(frozen=True, eq=False)
class Confidence:
    """How far to believe a map source -> target.

    Parameters
    ----------
    values
        Shape (N_source,), from 0 to 1: the probability that the vertex's partner is within 0.155 times the square root
        of the target's area of the true one (a tenth of a human's geodesic diameter); 0 without a partner.  It is
        calibrated, see `csm.matching.calibration`.
    distance
        Shape (N_source,): from each vertex of the source to where it returns on the way there and back, through space,
        in units of the square root of the source's area; infinite for vertices without a partner.
    ambiguous
        Whether a refinement found another map that is about as good, since the shapes look the same in several ways.
        `values` are those of the map that was taken, as if it were the only one.
    strained
        Whether even the best map of a search keeps areas, lengths and the descriptor badly; `values` do not know of it.
    """

    values: FloatArray
    distance: FloatArray
    ambiguous: bool = False
    strained: bool = False

    @property
    def returned(self) -> float:
        """Fraction of the matched vertices that return to within `csm.matching.signals.NEAR`."""
        matched = np.isfinite(self.distance)
        return float((self.distance[matched] < NEAR).mean()) if matched.any() else 0.0

    @property
    def trusted(self) -> float:
        """Fraction of the vertices of the source with a confidence of at least `TRUSTED`."""
        return float((self.values >= TRUSTED).mean()) if len(self.values) else 0.0

    @property
    def verdict(self) -> str:
        """One sentence for people on how far to believe the map."""
        added = (text for text, holds in ((AMBIGUOUS, self.ambiguous), (STRAINED, self.strained)) if holds)
        return "; ".join([self._share, *added])

    @property
    def _share(self) -> str:
        """Say how much of the source has a trustworthy partner."""
        if self.trusted >= 0.9:
            share = "all" if self.trusted == 1 else f"{np.floor(100 * self.trusted):.0f} %"
            right = self.values.mean()
            wrong = f", of which about one in {1 / (1 - right):.0f} may still be wrong" if right < 0.98 else ""
            return f"{share} of the source has a trustworthy partner (a confidence of {TRUSTED:g} or more){wrong}"
        share = _in_words(1 - self.trusted)
        if self.trusted >= 0.6:
            return (
                f"{share} of the source has no trustworthy partner: limbs may be exchanged, a part may be missing, or "
                "the shapes differ there"
            )
        return (
            f"WARNING: {share} of the source has no trustworthy partner: the two shapes may be of different kinds, or "
            "one may be a part of the other; do not use this map without looking at it"
        )

    def __repr__(self) -> str:
        return f"Confidence({counted(len(self.values), 'vertex')}, {100 * self.trusted:.0f} % trusted)"


def _in_words(share: float) -> str:
    """Return a share of less than all in words.

    Examples
    --------
    >>> _in_words(0.34), _in_words(0.97)
    ('about a third', 'almost all')
    """
    words = ((0.15, "about a tenth"), (0.22, "about a fifth"), (0.29, "about a quarter"), (0.4, "about a third"))
    for most, text in (*words, (0.6, "about half"), (0.72, "about two thirds"), (0.9, "most")):
        if share < most:
            return text
    return "almost all"


def confidence_of(sides: Sides, start: VertexMap | None = None) -> Confidence:
    """Compute how far to believe a map.

    Parameters
    ----------
    sides
        The shapes and the maps in both directions.
    start
        What the map was refined from; None if it is not refined.

    Returns
    -------
    Confidence
        0 where the map has no partner.
    """
    distance = there_and_back(sides.forward, sides.backward, sides.source.mesh)
    signals = map_signals(sides)
    if start is None:
        values = calibration("map").probability(signals)
    else:
        signals = np.hstack([signals, spectral_signals(sides, start)])
        values = refined_probability(calibration("refined"), signals)
    return Confidence(np.where(sides.forward.indices >= 0, values, 0.0), distance)


def refined_probability(found: Calibration, signals: FloatArray) -> FloatArray:
    """Return the probability by a calibration of refined maps, or less where a vertex does not return to its place.

    A refined map and the one back are two sides of one functional map: what does not return shares its partner with
    another part of the source, such as the other arm of a target that lacks one.  Pairs to fit on have too little of
    that, so the probability is at most exp(-(distance / NEAR)^2).

    Parameters
    ----------
    found
        The calibration.
    signals
        Shape (N, S): `OF_MAPS` and `OF_REFINED`.
    """
    back = signals[:, OF_MAPS.index("back")]
    return np.minimum(found.probability(signals), np.exp(-((back / NEAR) ** 2)))


def there_and_back(forward: VertexMap, backward: VertexMap, source: Mesh) -> FloatArray:
    """Return how far the vertices of the source are from where they return.

    Parameters
    ----------
    forward, backward
        Maps source -> target and target -> source.
    source
        The shape on which distances are measured, through space.

    Returns
    -------
    FloatArray
        Shape (N_source,), in units of the square root of the source's area; infinite without a match.
    """
    there = forward.indices
    back = np.where(there >= 0, backward.indices[there], -1)
    away = np.linalg.norm(source.vertices[back] - source.vertices, axis=1) / np.sqrt(body_of(source).area)
    return np.where(back >= 0, away, np.inf)


def share_returning(source: Mesh, at: IntArray, here: NDArray[Any] | Tensor, there: NDArray[Any] | Tensor) -> float:
    """Return how many nearest neighbours return to within `NEAR` on the way there and back, by descriptors alone.

    Parameters
    ----------
    source
        N_source vertices.
    at
        Those that are tried.
    here, there
        Descriptors of both shapes, (N_source, Q) and (N_target, Q).

    Returns
    -------
    float
        A fraction of the tried vertices.
    """
    back = nearest(there[nearest(here[at], there)], here)
    away = np.linalg.norm(source.vertices[back] - source.vertices[at], axis=1)
    return float((away < NEAR * np.sqrt(body_of(source).area)).mean())


def returning_both_ways(source: Described, target: Described) -> tuple[float, float]:
    """Return how many nearest neighbours of samples of the source return to their place, and how many of the target."""
    ways = ((source, target), (target, source))
    forth, back = (share_returning(here.mesh, here.order[:SAMPLES], here.rows, there.rows) for here, there in ways)
    return forth, back
