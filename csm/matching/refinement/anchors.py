"""Partners that a refinement has no reason to take away: nearest neighbours that return to their vertex."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from csm._types import FloatArray, IntArray
from csm.matching.barycentric import BarycentricMap
from csm.matching.base import Described
from csm.matching.maps import VertexMap
from csm.matching.nearest import nearest
from csm.matching.refinement.base import RefinedMap
from csm.matching.way import Way

SURE = 0.05
"""How close to itself a vertex returns on the way there and back whose partner is kept, in units of sqrt(area)."""

FAR = 0.15
"""How far a refinement may move such a partner, in the same units: about a tenth of a human's geodesic diameter."""


def anchored(done: RefinedMap, source: Described, target: Described) -> RefinedMap:
    """Return a refined map with the nearest neighbours that return in place of partners that are far from them.

    Functional maps know shapes by their coarse form, and where this differs they may carry a hand along to a place that
    no descriptor speaks for.
    """
    there, back = nearest(source.rows, target.rows), nearest(target.rows, source.rows)
    backward = None if done.backward is None else _kept(done.backward, target, source, back, there)
    return replace(done, forward=_kept(done.forward, source, target, there, back), backward=backward)


def _kept(way: Way, here: Described, other: Described, there: IntArray, back: IntArray) -> Way:
    found = way.vertex_map
    returns = _apart(here, back[there], np.arange(len(there))) < SURE
    at = np.flatnonzero(returns & (_apart(other, there, found.indices) > FAR))
    if len(at) == 0:
        return way
    indices = found.indices.copy()
    indices[at] = there[at]
    moved, precise = replace(found, indices=indices), way.precise
    return replace(way, vertex_map=moved, precise=None if precise is None else lambda: _pinned(precise(), moved, at))


def _apart(shape: Described, first: IntArray, second: IntArray) -> FloatArray:
    """Return the distances through space between vertices, in units of sqrt(area)."""
    points = shape.mesh.vertices
    apart: FloatArray = np.linalg.norm(points[first] - points[second], axis=1) / np.sqrt(shape.mesh.area)
    return apart


def _pinned(precise: BarycentricMap, found: VertexMap, at: IntArray) -> BarycentricMap:
    """Return a map into faces with some vertices at those of a map to vertices."""
    corners = BarycentricMap.of_vertices(found, precise.target_faces)
    faces, weights = precise.faces.copy(), precise.weights.copy()
    faces[at], weights[at] = corners.faces[at], corners.weights[at]
    return replace(precise, faces=faces, weights=weights)
