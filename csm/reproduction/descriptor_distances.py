"""Figures 5 and 6: how far descriptors are from that of a marked vertex, on the same shape and on other shapes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from csm._types import Float32Array, FloatArray
from csm.data.shapes import Shape
from csm.errors import ConfigError
from csm.operators.geodesic import geodesics
from csm.operators.laplacian import vertex_areas
from csm.reproduction.bodies import Bodies, OnBodies, describe, find_bodies, landmark_vertices
from csm.reproduction.published import label
from csm.reproduction.study import Context, Findings
from csm.viewer.camera import View
from csm.viewer.grid import Panel, Scale, scalar_grid

NEAR = 0.1
"""What counts as near, in the unit of the colours."""

_QUERY = "query"
_FIGURE_5 = (
    "Distances are Euclidean; those of a descriptor are divided by the 99th percentile of its distances from all "
    "marked vertices, so colours of a row can be compared, and between rows only where they lie.",
    f"near: fraction of the area with a distance below {NEAR:g}; smaller is more distinctive.",
)
_MIRROR = "mirror: distance to the left-right counterpart of the vertex; 0 cannot tell left from right."
_FIGURE_6 = (
    "Distances are Euclidean; those of a descriptor are divided by the 99th percentile of its distances on the query "
    "shape itself, in every column, so that a change of level between shapes is seen.",
    "The dot marks the vertex on the query shape and where it truly belongs on the others; a ring without filling lies "
    "behind the surface.",
    "distance: from the query's descriptor to that of the true vertex, in this unit. nearer: fraction of vertices "
    "whose descriptor is nearer than the true vertex's; 0 is best. error: geodesic distance (heat method) from the "
    "true vertex to the one with the nearest descriptor, as a fraction of the square root of the area.",
)


@dataclass(frozen=True)
class _Pictures(OnBodies):
    """A study that draws descriptor distances, one row per descriptor.

    Parameters
    ----------
    size
        Width and height of a panel in pixels.
    blocks
        Columns of text that the rows are set in.
    """

    size: tuple[int, int] = (200, 310)
    blocks: int = 2

    def draw(self, bodies: Bodies, grid: Mapping[str, Sequence[Panel]], columns: Sequence[str], unit: str) -> Figure:
        """Return the picture of a grid of panels, by the names of its rows, with the unit under the colour bar."""
        view = View(up=bodies.up)
        return scalar_grid(grid, columns, Scale(unit), view=view, size=self.size, blocks=self.blocks)


@dataclass(frozen=True)
class Figure5(_Pictures):
    """The distances on one body, one column per marked vertex."""

    def run(self, context: Context) -> Findings:
        """Describe the body and draw."""
        bodies = find_bodies(self.source, context)
        shape = bodies.original.load(bodies.body)
        marks = landmark_vertices(bodies, shape)
        areas = vertex_areas(shape.mesh) / shape.mesh.area
        mirror = None if shape.mirror is None else shape.mirror.as_template_to_shape().indices
        rows: list[dict[str, Any]] = []
        grid: dict[str, list[Panel]] = {}
        for name, values in describe(shape.mesh, self.descriptors, context.store).items():
            raw = {mark: distances_from(values[vertex], values) for mark, vertex in marks.items()}
            unit = unit_of(raw.values())
            grid[label(name)] = [Panel(shape.mesh, raw[mark] / unit, vertex) for mark, vertex in marks.items()]
            for mark, distance in raw.items():
                near = float(areas[distance / unit < NEAR].sum())
                rows.append({"descriptor": name, "vertex": mark, "near": near})
                if mirror is not None:
                    rows[-1]["mirror"] = float(distance[mirror[bodies.landmarks[mark]]] / unit)
        where = f"{bodies.title}, {shape.name}"
        return self.findings(
            context,
            f"Distance in descriptor space from a marked vertex to all vertices of one shape ({where}).",
            ("descriptor", "vertex", "near", *([] if mirror is None else ["mirror"])),
            rows,
            _FIGURE_5 if mirror is None else (*_FIGURE_5, _MIRROR),
            self.draw(bodies, grid, list(marks), "distance of descriptors, 1 = 99th percentile of the row"),
        )


@dataclass(frozen=True)
class Figure6(_Pictures):
    """The distances from a vertex of one body on itself and on others.

    Parameters
    ----------
    landmark
        The marked vertex, by its name in the bodies' landmarks.
    """

    landmark: str = "left knee"

    def run(self, context: Context) -> Findings:
        """Describe the bodies and draw; ConfigError if there is no such landmark."""
        bodies = find_bodies(self.source, context)
        if self.landmark not in bodies.landmarks:
            raise ConfigError(f"landmark={self.landmark!r} is unknown; there are {', '.join(bodies.landmarks)}")
        shapes = _compared(bodies)
        true = {title: landmark_vertices(bodies, shape)[self.landmark] for title, shape in shapes.items()}
        described = {t: describe(shape.mesh, self.descriptors, context.store) for t, shape in shapes.items()}
        rows: list[dict[str, Any]] = []
        grid: dict[str, list[Panel]] = {}
        for name in self.descriptors:
            query = described[_QUERY][name][true[_QUERY]]
            raw = {title: distances_from(query, values[name]) for title, values in described.items()}
            unit = unit_of([raw[_QUERY]])
            grid[label(name)] = [Panel(shapes[title].mesh, d / unit, true[title]) for title, d in raw.items()]
            others = [title for title in shapes if title != _QUERY]
            scores = {title: _scores(shapes[title], raw[title] / unit, true[title]) for title in others}
            rows += [{"descriptor": name, "shape": title, **scores[title]} for title in others]
        where = f"from the {self.landmark} of one shape to all vertices of others ({bodies.title})"
        unit_text = "distance from the descriptor of the marked vertex, 1 = 99th percentile on the query shape"
        columns = ("descriptor", "shape", "distance", "nearer", "error")
        figure = self.draw(bodies, grid, list(shapes), unit_text)
        return self.findings(context, f"Distance in descriptor space {where}.", columns, rows, _FIGURE_6, figure)


def distances_from(query: Float32Array, values: Float32Array) -> FloatArray:
    """Return the Euclidean distances of one row (Q,) from all rows (N, Q), shape (N,)."""
    distances: FloatArray = np.linalg.norm(values.astype(np.float64) - query.astype(np.float64), axis=1)
    return distances


def unit_of(distances: Iterable[FloatArray]) -> float:
    """Return the 99th percentile of distances, the unit of their colours; 1 if they are all 0."""
    return float(np.percentile(np.concatenate(list(distances)), 99)) or 1.0


def _compared(bodies: Bodies) -> dict[str, Shape]:
    """Return the query shape and those that it is compared with, by the labels of their columns."""
    names = {_QUERY: bodies.body, "other pose": bodies.other_pose, "other person": bodies.other_person}
    meshed_otherwise = list(bodies.corresponding.items())[-2:]
    return {title: bodies.original.load(name) for title, name in names.items()} | {
        title: shapes.load(bodies.body) for title, shapes in meshed_otherwise
    }


def _scores(shape: Shape, distance: FloatArray, true: int) -> dict[str, float]:
    nearest = np.array([int(distance.argmin())])
    gap = geodesics(shape.mesh, "heat").pairs(np.array([true]), nearest)[0]
    return {
        "distance": float(distance[true]),
        "nearer": float((distance < distance[true]).mean()),
        "error": float(gap / np.sqrt(shape.mesh.area)),
    }
