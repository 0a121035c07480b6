"""How far to believe a map: does a vertex that goes to the other shape and back return to where it began?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from torch import Tensor

from csm._types import FloatArray
from csm.matching.embedded import farthest_points
from csm.matching.maps import VertexMap
from csm.matching.nearest import nearest
from csm.mesh.debris import body_of
from csm.mesh.shape import Mesh

NEAR = 0.1
"""Distance from which a vertex counts as not having come back, in units of the square root of the source's area."""


@dataclass(frozen=True, eq=False)
class Confidence:
    """What going there and back says of a map.

    Parameters
    ----------
    distance
        Shape (N_source,): from each vertex of the source to where it returns, through space, in units of the square
        root of the source's area; infinite for vertices without a match.
    """

    distance: FloatArray

    @property
    def values(self) -> FloatArray:
        """Shape (N_source,): 1 where a vertex returns to its place, 0.37 at the distance `NEAR`, 0 without a match."""
        values: FloatArray = np.exp(-((self.distance / NEAR) ** 2))
        return values

    @property
    def returned(self) -> float:
        """Fraction of the matched vertices that return to within `NEAR`."""
        matched = np.isfinite(self.distance)
        return float((self.distance[matched] < NEAR).mean()) if matched.any() else 0.0

    @property
    def verdict(self) -> str:
        """One sentence for people on how far to believe the map."""
        share = f"{100 * self.returned:.0f} % of the matched vertices return to their place on the way there and back"
        if self.returned >= 0.9:
            return f"{share}, so most of the map is consistent"
        if self.returned >= 0.6:
            return f"{share}; where they do not, limbs may be exchanged or a part may have no partner"
        return (
            f"WARNING: only {share}, so this map is probably wrong in large parts: the shapes may differ in kind, or "
            "one may be a part of the other"
        )


def there_and_back(forward: VertexMap, backward: VertexMap, source: Mesh) -> Confidence:
    """Compare where the vertices of the source begin with where they return.

    Parameters
    ----------
    forward, backward
        Maps source -> target and target -> source.
    source
        The shape on which distances are measured.
    """
    there = forward.indices
    back = np.where(there >= 0, backward.indices[there], -1)
    away = np.linalg.norm(source.vertices[back] - source.vertices, axis=1) / np.sqrt(body_of(source).area)
    return Confidence(np.where(back >= 0, away, np.inf))


def share_returning(source: Mesh, here: Tensor, there: Tensor, *, samples: int = 1000) -> float:
    """Return how many nearest neighbours return to within `NEAR` on the way there and back, by descriptors alone.

    Parameters
    ----------
    source
        N_source vertices.
    here, there
        Descriptors of both shapes, (N_source, Q) and (N_target, Q).
    samples
        Vertices that are tried, spread over the source.

    Returns
    -------
    float
        A fraction of the tried vertices.
    """
    at = farthest_points(source.vertices, samples)
    back = nearest(there[nearest(here[at], there)], here)
    away = np.linalg.norm(source.vertices[back] - source.vertices[at], axis=1)
    return float((away < NEAR * np.sqrt(body_of(source).area)).mean())
