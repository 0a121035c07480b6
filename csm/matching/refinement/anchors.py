"""Partners that a refinement has no reason to take away: nearest neighbours that return to their vertex."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from csm._types import IntArray
from csm.matching.barycentric import BarycentricMap
from csm.matching.base import Described
from csm.matching.confidence import there_and_back
from csm.matching.maps import VertexMap
from csm.matching.refinement.base import RefinedMap
from csm.matching.refinement.clusters import nearest_of_many
from csm.matching.way import Way
from csm.mesh.debris import body_of

SURE = 0.05
"""How close to itself a vertex returns on the way there and back whose partner is kept, in units of sqrt(area)."""

FAR = 0.15
"""How far points in faces may be from such a partner, in the same units: a tenth of a human's geodesic diameter."""


class ThereAndBack(NamedTuple):
    """Maps between two shapes, source -> target and target -> source."""

    there: VertexMap
    back: VertexMap


def nearest_both_ways(source: Described, target: Described) -> ThereAndBack:
    """Return the nearest neighbours of both shapes in each other."""
    return ThereAndBack(_nearest(source, target), _nearest(target, source))


def astray(ways: ThereAndBack, source: Described, target: Described) -> float:
    """Return how far vertices are from where they return, on average over both shapes, counted up to `SURE`.

    Of two maps of one pair the better one mostly has less, where none has parts that are far off.
    """
    there = there_and_back(ways.there, ways.back, source.mesh)
    back = there_and_back(ways.back, ways.there, target.mesh)
    return float(sum(np.minimum(distance, SURE).mean() for distance in (there, back)) / 2)


def anchored(done: RefinedMap, source: Described, target: Described, nearest: ThereAndBack) -> RefinedMap:
    """Return a refined map in which vertices whose nearest neighbours return have these for partners.

    What is refined then is the rest: vertices that the descriptor is not sure of.  Functional maps know shapes by their
    coarse form; they blur what a network knows to the vertex, and where the forms differ they may carry a hand along to
    a place that no descriptor speaks for.  The map into faces stays the refined one, which is smooth, but where that is
    far from the partner.  A functional map stays as it was: it is too coarse to tell the difference.
    """
    there, back = nearest
    backward = None if done.backward is None else _kept(done.backward, target, source, back, there)
    return replace(done, forward=_kept(done.forward, source, target, there, back), backward=backward)


def _nearest(here: Described, other: Described) -> VertexMap:
    found = nearest_of_many(here.features.float(), other.features.float(), other.order)
    return VertexMap(found.cpu().numpy(), other.mesh.n_vertices)


def _kept(way: Way, here: Described, other: Described, there: VertexMap, back: VertexMap) -> Way:
    found, sure = way.vertex_map, there.indices
    returns = there_and_back(there, back, here.mesh) < SURE
    changed = returns & (found.indices >= 0) & (found.indices != sure)
    if not changed.any():
        return way
    kept = replace(found, indices=np.where(changed, sure, found.indices))
    places, precise = other.mesh.vertices, way.precise
    apart = np.linalg.norm(places[sure] - places[found.indices], axis=1)
    far = np.flatnonzero(changed & (apart > FAR * np.sqrt(body_of(other.mesh).area)))
    return replace(way, vertex_map=kept, precise=None if precise is None else lambda: _pinned(precise(), kept, far))


def _pinned(precise: BarycentricMap, found: VertexMap, at: IntArray) -> BarycentricMap:
    """Return a map into faces with some vertices at those of a map to vertices."""
    corners = BarycentricMap.of_vertices(found, precise.target_faces)
    faces, weights = precise.faces.copy(), precise.weights.copy()
    faces[at], weights[at] = corners.faces[at], corners.weights[at]
    return replace(precise, faces=faces, weights=weights)
