"""How much the descriptor of a point changes when the shape is given in another triangulation.

A descriptor that is the same everywhere does not change at all, so the change stands beside what separates different
points (`contrast`), and beside the error of matching the two triangulations by nearest neighbours.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from csm._types import Float32Array, IntArray
from csm.data.shapeset import Shape
from csm.errors import DataError
from csm.evaluation.distances import MatchedPoints, target_errors
from csm.evaluation.matching import nearest
from csm.mesh.correspondence import GroundTruth, ground_truth
from csm.operators.geodesic import Method
from csm.studies.bodies import RIVALS, Bodies, Source, describe, find_bodies, label
from csm.studies.study import Context, Findings
from csm.viewer.comparisons import dots_figure
from csm.viewer.figures import save_figure


def run(
    context: Context,
    *,
    source: Source | Bodies = "auto",
    descriptors: Sequence[str] = RIVALS,
    points: int = 500,
    distance: Method = "exact",
) -> Findings:
    """Compare the descriptors of one body in its own and in all its other triangulations.

    Parameters
    ----------
    context
        Where data and artefacts are.
    source
        Of the bodies; see `csm.studies.bodies.find_bodies`.
    descriptors
        Names of presets, in order.
    points
        How many corresponding points are matched, drawn without replacement; changes are measured at all.
    distance
        Kind of geodesic distance of the errors.

    Raises
    ------
    DataError
        If there is no other triangulation over the same template.
    """
    bodies = find_bodies(source, context)
    others = bodies.corresponding
    if not others:
        raise DataError(f"stability: no other triangulation of {bodies.title} has the same template")
    original = bodies.original.load(bodies.body)
    here = describe(original.mesh, descriptors, context.store)
    table: dict[tuple[str, str], dict[str, Any]] = {}
    for title, shapes in others.items():
        other = shapes.load(bodies.body)
        there = describe(other.mesh, descriptors, context.store)
        pairs = ground_truth(original.truth, other.truth)
        matched: list[MatchedPoints] = []
        chosen = np.random.default_rng(context.seed).permutation(len(pairs.source))[:points]
        for name in descriptors:
            changes = _changes(here[name], there[name], pairs, context.seed)
            table[name, title] = {"descriptor": name, "mesh": title, **changes}
            found = nearest(here[name][pairs.source[chosen]], there[name])
            matched.append(MatchedPoints(pairs.target[chosen], found))
        measured = target_errors(other.mesh, distance, "diameter", matched)
        for name, errors in zip(descriptors, measured.errors, strict=True):
            table[name, title]["error"] = 1000 * float(errors.distance.mean()) / measured.lengths.diameter
    rows = [table[name, title] for name in descriptors for title in others]
    path = context.out / "stability.png"
    _draw(rows, [label(name) for name in descriptors], list(others), path)
    title = f"Descriptors of one point of one shape in two triangulations ({bodies.title}, {bodies.body})."
    return Findings("stability", title, ("descriptor", "mesh", *_QUANTITIES), rows, _notes(original, points), (path,))


_QUANTITIES = ("change", "contrast", "error")


def _notes(original: Shape, points: int) -> tuple[str, ...]:
    return (
        f"From {original.mesh.n_vertices:,} vertices to each other mesh. The refined meshes have the vertices of the "
        "original first, so a point is the same point exactly; on a remeshed one it is the nearest vertex.",
        "change: median over points of |f - f'| / |f|. contrast: mean |f - f'| over the mean distance between the "
        "descriptors of two random points of the original; below 1 points can be told apart at all.",
        f"error: mean geodesic error of nearest-neighbour matching of {points} points onto the other mesh, in "
        "thousandths of its diameter.",
    )


def _changes(here: Float32Array, there: Float32Array, pairs: GroundTruth, seed: int) -> dict[str, float]:
    """Measure the change of descriptors at corresponding points (P), relative to their length and to chance."""
    f, g = here[pairs.source].astype(np.float64), there[pairs.target].astype(np.float64)
    gap, length = np.linalg.norm(f - g, axis=1), np.linalg.norm(f, axis=1)
    stranger: IntArray = np.random.default_rng(seed).permutation(len(f))
    apart = float(np.linalg.norm(f - f[stranger], axis=1).mean())
    known = length > 0
    return {
        "change": float(np.median(gap[known] / length[known])) if known.any() else 0.0,
        "contrast": float(gap.mean()) / apart if apart > 0 else 1.0,
    }


def _draw(rows: Sequence[dict[str, Any]], names: Sequence[str], meshes: Sequence[str], path: Path) -> None:
    axes = {"contrast": "change / distance of random points", "error": "matching error (thousandths of the diameter)"}
    panels = {
        text: {mesh: [row[quantity] for row in rows if row["mesh"] == mesh] for mesh in meshes}
        for quantity, text in axes.items()
    }
    save_figure(path, dots_figure(names, panels))
