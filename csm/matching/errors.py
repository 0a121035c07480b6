"""How far a map is from a known one, vertex by vertex."""

from __future__ import annotations

from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from csm._types import FloatArray
from csm.errors import ConfigError, DataError
from csm.matching.maps import VertexMap
from csm.mesh.shape import Mesh
from csm.operators.geodesic import Method as Distance
from csm.operators.geodesic import geodesics

Normaliser: TypeAlias = Literal["diameter", "sqrt_area"]


def map_errors(
    found: VertexMap,
    truth: VertexMap | ArrayLike,
    target: Mesh,
    distance: Distance = "exact",
    normaliser: Normaliser = "diameter",
) -> FloatArray:
    """Return the geodesic distance on the target from the true to the found vertex, for each vertex of the source.

    Conventions are those of `csm.evaluate`: a pair that no path joins is as far apart as the diameter.

    Parameters
    ----------
    found
        The map source -> target.
    truth
        Shape (N_source,): the true target vertex of each vertex of the source, -1 where it is unknown.
    target
        The mesh that distances are measured on.
    distance
        "exact", "heat" or "edge", see `csm.geodesics`.  Exact distances take up to 0.1 s for each far miss.
    normaliser
        What errors are divided by: "diameter", the geodesic diameter of the target by the same kind of distance, or
        "sqrt_area", the square root of its area.

    Returns
    -------
    FloatArray
        Shape (N_source,); NaN where the truth is unknown or the map has no partner (-1).

    Raises
    ------
    DataError
        If the truth is no map between shapes of these sizes.
    ConfigError
        If there is no such distance or normaliser.
    MeshError
        If the target is no manifold, which exact distances need.

    Examples
    --------
    >>> square = Mesh(np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), np.array([[0, 1, 2], [0, 2, 3]]))
    >>> map_errors(VertexMap(np.array([0, 1, 2]), 4), [0, 2, -1], square, normaliser="sqrt_area")
    array([ 0.,  1., nan])
    """
    if normaliser not in ("diameter", "sqrt_area"):
        raise ConfigError(f"normaliser={normaliser}; wanted diameter or sqrt_area")
    known = _known(found, truth, target)
    surface = geodesics(target, distance)
    asked = np.flatnonzero((known.indices >= 0) & (found.indices >= 0))
    errors = np.full(len(found), np.nan)
    between = surface.pairs(known.indices[asked], found.indices[asked])
    diameter = surface.diameter()
    worst = max(diameter, float(between[np.isfinite(between)].max(initial=0.0)))
    errors[asked] = np.minimum(between, worst)
    return errors / (diameter if normaliser == "diameter" else float(np.sqrt(target.area)))


def _known(found: VertexMap, truth: VertexMap | ArrayLike, target: Mesh) -> VertexMap:
    """Return the truth as a map that fits to the one that was found."""
    given = truth.indices if isinstance(truth, VertexMap) else np.asarray(truth)
    known = VertexMap(given, target.n_vertices, f"the truth of {found.source}", found.target)
    n = found.n_target if not isinstance(truth, VertexMap) else truth.n_target
    if len(known) != len(found) or n != target.n_vertices or found.n_target != n:
        raise DataError(
            f"{found.source} -> {found.target}: a map of {len(found)} to {found.n_target} vertices, a truth of "
            f"{len(known)} to {n} and a mesh of {target.n_vertices} do not fit; wanted the true vertex of "
            f"{found.target} for each vertex of {found.source}"
        )
    return known
