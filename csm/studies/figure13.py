"""Figure 13: matching onto shapes with parts cut away, and onto shapes that have grown together where they touch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np

from csm.errors import ConfigError
from csm.mesh.perturb import Damaged, grown_together, with_noise, without_part
from csm.mesh.shape import Mesh
from csm.operators.geodesic import Method
from csm.studies.bodies import Bodies, Source, find_bodies
from csm.studies.contestants import contestants
from csm.studies.damage import Damage, Plan, by_method, damage_rows
from csm.studies.study import MEAN_ERROR, Context, Findings
from csm.viewer.comparisons import dots_figure
from csm.viewer.figures import save_figure


def run(
    context: Context,
    *,
    source: Source | Bodies = "auto",
    descriptors: Sequence[str] = ("acd", "acd_paper", "hks"),
    checkpoints: Mapping[str, str] | None = None,
    fractions: Sequence[float] = (0.02, 0.05, 0.1, 0.2),
    n_pairs: int = 20,
    points: int = 300,
    distance: Method = "exact",
) -> Findings:
    """Match whole bodies onto such with a part cut away, and onto such with one wrong handle.

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
    fractions
        Shares of the area that are cut away, around one of the extremities.
    n_pairs, points, distance
        See `csm.studies.damage.Plan`.

    Raises
    ------
    ConfigError
        If there is no method, or a fraction is not between 0 and 1.
    """
    if any(not 0 < fraction < 1 for fraction in fractions):
        raise ConfigError(f"figure13: fractions are between 0 and 1, got {list(fractions)}")
    bodies = find_bodies(source, context)
    methods = contestants(descriptors, checkpoints, context, bodies)
    damages: dict[str, Damage] = {"none": partial(with_noise, strength=0.0)}
    damages |= {f"{100 * f:g} % cut away": partial(cut_extremity, fraction=float(f)) for f in fractions}
    damages["grown together"] = grown_together
    rows = damage_rows(context, bodies, damages, methods, Plan(n_pairs, points, distance))
    path = context.out / "figure13.png"
    errors = {(row["method"], row["damage"]): row["error"] for row in rows}
    drawn = {
        damage: [float("nan") if (error := errors[method, damage]) is None else error for method in methods]
        for damage in damages
    }
    save_figure(path, dots_figure(list(methods), {MEAN_ERROR: drawn}))
    title = f"Matching onto damaged shapes ({bodies.title}), errors in thousandths of the diameter."
    notes = (
        f"{n_pairs} ordered pairs of the last twenty bodies, {points} points left on the target each, distance "
        f"{distance} on the whole target. What is cut away lies around the vertex that is farthest from the middle of "
        "the body. Grown together: a bridge of six triangles where the surface comes nearest to itself although the "
        "way along it is at least half of sqrt(area). ± is the standard error over targets.",
        *sorted({f"{row['method']}, {row['damage']}: {row['failed']}" for row in rows if "failed" in row}),
    )
    return Findings("figure13", title, ("method", *damages), by_method(rows), notes, (path,))


def cut_extremity(mesh: Mesh, fraction: float) -> Damaged:
    """Cut so much of the area away around the vertex that is farthest from the centre of the surface."""
    areas = mesh.face_areas
    middle = areas @ mesh.corners.mean(axis=1) / areas.sum()
    farthest = int(np.linalg.norm(mesh.vertices - middle, axis=1).argmax())
    return without_part(mesh, farthest, fraction)
