"""Figure 5: how far the descriptors of all vertices of one shape are from those of a few marked ones."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from csm._types import Float32Array, FloatArray
from csm.operators.laplacian import vertex_areas
from csm.studies.bodies import RIVALS, Bodies, Source, describe, find_bodies, label, landmark_vertices
from csm.studies.study import Context, Findings
from csm.viewer.camera import View
from csm.viewer.figures import save_figure
from csm.viewer.grid import Panel, Scale, scalar_grid

TOP = 99.0
"""Percentile of a descriptor's distances that is the unit of its colours."""

NEAR = 0.1
"""What counts as near, in that unit."""


def run(
    context: Context,
    *,
    source: Source | Bodies = "auto",
    descriptors: Sequence[str] = RIVALS,
    size: tuple[int, int] = (200, 310),
    blocks: int = 2,
) -> Findings:
    """Draw the distances on one body, one row per descriptor and one column per marked vertex.

    Parameters
    ----------
    context
        Where data and artefacts are.
    source
        Of the bodies; see `csm.studies.bodies.find_bodies`.
    descriptors
        Names of presets, in order.
    size
        Width and height of a panel in pixels.
    blocks
        Columns of text that the rows are set in.
    """
    bodies = find_bodies(source, context)
    shape = bodies.original.load(bodies.body)
    marks = landmark_vertices(bodies, shape)
    areas = vertex_areas(shape.mesh) / shape.mesh.area
    mirror = None if shape.mirror is None else shape.mirror.as_template_to_shape().indices
    rows: list[dict[str, Any]] = []
    grid: dict[str, list[Panel]] = {}
    for name, values in describe(shape.mesh, descriptors, context.store).items():
        distances = normalised([distances_from(values[v], values) for v in marks.values()])
        grid[label(name)] = [Panel(shape.mesh, d, v) for d, v in zip(distances, marks.values(), strict=True)]
        for (mark, _), distance in zip(marks.items(), distances, strict=True):
            row: dict[str, Any] = {"descriptor": name, "vertex": mark, "near": float(areas[distance < NEAR].sum())}
            if mirror is not None:
                row["mirror"] = float(distance[mirror[bodies.landmarks[mark]]])
            rows.append(row)
    path = context.out / "figure5.png"
    scale = Scale("distance of descriptors, 1 = 99th percentile of the row")
    save_figure(path, scalar_grid(grid, list(marks), scale, view=View(up=bodies.up), size=size, blocks=blocks))
    columns = ("descriptor", "vertex", "near", *(("mirror",) if mirror is not None else ()))
    return Findings("figure5", _TITLE.format(bodies.title, shape.name), columns, rows, _notes(mirror), (path,))


_TITLE = "Distance in descriptor space from a marked vertex to all vertices of one shape ({}, {})."


def _notes(mirror: object) -> tuple[str, ...]:
    unit = (
        "Distances are Euclidean; those of a descriptor are divided by the 99th percentile of its distances from all "
        "marked vertices, so colours of a row can be compared, and between rows only where they lie."
    )
    notes = [unit, f"near: fraction of the area with a distance below {NEAR:g}; smaller is more distinctive."]
    if mirror is not None:
        notes.append("mirror: distance to the left-right counterpart of the vertex; 0 cannot tell left from right.")
    return tuple(notes)


def distances_from(query: Float32Array, values: Float32Array) -> FloatArray:
    """Return the Euclidean distances of one row (Q,) from all rows (N, Q), shape (N,)."""
    gaps: FloatArray = values.astype(np.float64) - query.astype(np.float64)
    distances: FloatArray = np.linalg.norm(gaps, axis=1)
    return distances


def normalised(distances: Sequence[FloatArray], unit: float | None = None) -> list[FloatArray]:
    """Divide by `unit`, by default the `TOP` percentile of all; distances that are all 0 stay so."""
    unit = float(np.percentile(np.concatenate(list(distances)), TOP)) if unit is None else unit
    return [d / (unit or 1.0) for d in distances]
