"""Figure 6: how far the descriptors on other shapes are from that of one marked vertex."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from csm.data.shapeset import Shape
from csm.errors import ConfigError
from csm.operators.geodesic import geodesics
from csm.studies.bodies import RIVALS, Bodies, Source, describe, find_bodies, label, landmark_vertices
from csm.studies.figure5 import TOP, distances_from, normalised
from csm.studies.study import Context, Findings
from csm.viewer.camera import View
from csm.viewer.figures import save_figure
from csm.viewer.grid import Panel, Scale, scalar_grid


def run(
    context: Context,
    *,
    source: Source | Bodies = "auto",
    descriptors: Sequence[str] = RIVALS,
    landmark: str = "left knee",
    size: tuple[int, int] = (200, 310),
    blocks: int = 2,
) -> Findings:
    """Draw the distances from a vertex of one body on itself and on others, one row per descriptor.

    Parameters
    ----------
    context
        Where data and artefacts are.
    source
        Of the bodies; see `csm.studies.bodies.find_bodies`.
    descriptors
        Names of presets, in order.
    landmark
        The marked vertex, by its name in the bodies' landmarks.
    size
        Width and height of a panel in pixels.
    blocks
        Columns of text that the rows are set in.

    Raises
    ------
    ConfigError
        If there is no such landmark.
    """
    bodies = find_bodies(source, context)
    if landmark not in bodies.landmarks:
        raise ConfigError(f"landmark={landmark!r} is unknown; there are {', '.join(bodies.landmarks)}")
    shapes = _shapes(bodies)
    true = {title: landmark_vertices(bodies, shape)[landmark] for title, shape in shapes.items()}
    described = {title: describe(shape.mesh, descriptors, context.store) for title, shape in shapes.items()}
    rows: list[dict[str, Any]] = []
    grid: dict[str, list[Panel]] = {}
    for name in descriptors:
        query = described[_QUERY][name][true[_QUERY]]
        raw = [distances_from(query, values[name]) for values in described.values()]
        unit = float(np.percentile(raw[0], TOP))
        distances = dict(zip(shapes, normalised(raw, unit), strict=True))
        grid[label(name)] = [Panel(shapes[t].mesh, d, true[t]) for t, d in distances.items()]
        rows += [
            {"descriptor": name, "shape": t, **_scores(shapes[t], d, true[t])}
            for t, d in distances.items()
            if t != _QUERY
        ]
    path = context.out / "figure6.png"
    scale = Scale("distance from the descriptor of the marked vertex, 1 = 99th percentile on the query shape")
    save_figure(path, scalar_grid(grid, list(shapes), scale, view=View(up=bodies.up), size=size, blocks=blocks))
    title = f"Distance in descriptor space from the {landmark} of one shape to all vertices of others ({bodies.title})."
    return Findings("figure6", title, ("descriptor", "shape", "distance", "nearer", "error"), rows, _NOTES, (path,))


_QUERY = "query"
_NOTES = (
    "Distances are Euclidean; those of a descriptor are divided by the 99th percentile of its distances on the query "
    "shape itself, in every column, so that a change of level between shapes is seen.",
    "The dot marks the vertex on the query shape and where it truly belongs on the others; a ring without filling lies "
    "behind the surface.",
    "distance: from the query's descriptor to that of the true vertex, in this unit. nearer: fraction of vertices "
    "whose descriptor is nearer than the true vertex's; 0 is best. error: geodesic distance (heat method) from the "
    "true vertex to the one with the nearest descriptor, as a fraction of the square root of the area.",
)


def _shapes(bodies: Bodies) -> dict[str, Shape]:
    """Return the query shape and those that it is compared with, by the labels of their columns."""
    found = {
        _QUERY: bodies.original.load(bodies.body),
        "other pose": bodies.original.load(bodies.other_pose),
        "other person": bodies.original.load(bodies.other_person),
    }
    for title, shapes in list(bodies.corresponding.items())[-2:]:
        found[title] = shapes.load(bodies.body)
    return found


def _scores(shape: Shape, distance: np.ndarray, true: int) -> dict[str, float]:
    nearest = np.array([int(distance.argmin())])
    gap = geodesics(shape.mesh, "heat").pairs(np.array([true]), nearest)[0]
    return {
        "distance": float(distance[true]),
        "nearer": float((distance < distance[true]).mean()),
        "error": float(gap / np.sqrt(shape.mesh.area)),
    }
