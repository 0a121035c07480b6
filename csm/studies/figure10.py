"""Figure 10: where on a body each method errs, at every triangulation: one body matched onto another person's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import torch
from scipy.spatial import cKDTree

from csm._types import FloatArray
from csm.data.shapeset import Shape
from csm.errors import ConfigError
from csm.evaluation.distances import MatchedPoints, target_errors
from csm.evaluation.matching import nearest
from csm.mesh.correspondence import ground_truth
from csm.mesh.shape import Mesh
from csm.operators.geodesic import Method
from csm.studies.bodies import Bodies, Source, find_bodies
from csm.studies.contestants import Contestant, contestants
from csm.studies.study import Context, Findings
from csm.viewer.camera import View
from csm.viewer.colors import ERROR_COLORMAP
from csm.viewer.figures import save_figure
from csm.viewer.grid import Panel, Scale, scalar_grid

NEAR = 0.05
"""How far, in units of sqrt(area), a picture takes an error over to vertices without a counterpart."""


def run(
    context: Context,
    *,
    source: Source | Bodies = "auto",
    descriptors: Sequence[str] = ("acd",),
    checkpoints: Mapping[str, str] | None = None,
    distance: Method = "edge",
    high: float = 0.1,
    size: tuple[int, int] = (200, 310),
) -> Findings:
    """Match one person onto another within every triangulation, and draw the error of every vertex.

    Parameters
    ----------
    context
        Where data and artefacts are.
    source
        Of the bodies; see `csm.studies.bodies.find_bodies`.
    descriptors
        Names of presets that match as they are.
    checkpoints
        Name -> file of a trained network; by default those of the learned tables, see
        `csm.studies.contestants.contestants`.
    distance
        Kind of geodesic distance of the errors.  Paths along edges are about 5 % too long, which no colour shows; exact
        distances from every vertex would take an hour where methods miss.
    high
        Error, as a fraction of the diameter, at the upper end of the colours.
    size
        Width and height of a panel in pixels.

    Raises
    ------
    ConfigError
        If there is no method, or `high` is not positive.
    """
    if not high > 0:
        raise ConfigError(f"figure10: high={high}; wanted an error above 0")
    bodies = find_bodies(source, context)
    methods = contestants(descriptors, checkpoints, context, bodies)
    table: dict[tuple[str, str], dict[str, Any]] = {}
    grid: dict[str, list[Panel]] = {name: [] for name in methods}
    for title, shapes in bodies.resolutions.items():
        here, there = shapes.load(bodies.body), shapes.load(bodies.other_person)
        for name, errors in zip(methods, vertex_errors(here, there, list(methods.values()), distance), strict=True):
            table[name, title] = {"method": name, "mesh": title, **_summary(errors[np.isfinite(errors)])}
            mesh = here.mesh.unit_area()  # so that all triangulations of a body are drawn of one size
            grid[name].append(Panel(mesh, filled(mesh, errors)))
    path = context.out / "figure10.png"
    scale = Scale("geodesic error (fraction of the diameter)", high, ERROR_COLORMAP)
    save_figure(path, scalar_grid(grid, list(bodies.resolutions), scale, view=View(up=bodies.up), size=size))
    title = f"{bodies.body} matched onto {bodies.other_person} ({bodies.title}), thousandths of the diameter."
    notes = (
        f"Errors at all vertices with a known counterpart, {distance} distances on the target, drawn on the body that "
        f"is matched. A vertex without a counterpart looks like the nearest one that has one within {NEAR} sqrt(area), "
        "and is grey beyond. Both bodies are triangulated alike in every column.",
        "The paper's own figure could not be seen, so this is what we take it for: errors across resolutions.",
    )
    rows = [table[name, title] for name in methods for title in bodies.resolutions]
    return Findings("figure10", title, ("method", "mesh", "error", "95th percentile", "exact %"), rows, notes, (path,))


def vertex_errors(here: Shape, there: Shape, methods: Sequence[Contestant], distance: Method) -> list[FloatArray]:
    """Return for each method the error of every vertex of the first shape, (N,), NaN where the truth is not known."""
    truth = ground_truth(here.truth, there.truth)
    matched = []
    for method in methods:
        queries = method.describe(here.mesh)[torch.as_tensor(truth.source)]
        matched.append(MatchedPoints(truth.target, nearest(queries, method.describe(there.mesh))))
    measured = target_errors(there.mesh, distance, "diameter", matched)
    found = []
    for errors in measured.errors:
        values = np.full(here.mesh.n_vertices, np.nan)
        values[truth.source] = errors.distance / measured.lengths.diameter
        found.append(values)
    return found


def filled(mesh: Mesh, values: FloatArray) -> FloatArray:
    """Give vertices without a value (NaN), on a mesh of unit area, that of the nearest known one up to `NEAR`."""
    known = np.flatnonzero(np.isfinite(values))
    distances, places = cKDTree(mesh.vertices[known]).query(mesh.vertices)
    return np.where(distances <= NEAR, values[known[places]], np.nan)


def _summary(errors: FloatArray) -> dict[str, float]:
    return {
        "error": 1000 * float(errors.mean()),
        "95th percentile": 1000 * float(np.percentile(errors, 95)),
        "exact %": 100 * float((errors == 0).mean()),
    }
