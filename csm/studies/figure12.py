"""Figure 12: the error of matching onto shapes whose vertices were moved by Gaussian noise, over its strength."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

from matplotlib.figure import Figure

from csm.errors import ConfigError
from csm.mesh.perturb import with_noise
from csm.operators.geodesic import Method
from csm.studies.bodies import Bodies, Source, find_bodies
from csm.studies.contestants import contestants
from csm.studies.damage import Plan, by_method, damage_rows
from csm.studies.study import MEAN_ERROR, Context, Findings
from csm.viewer.figures import save_figure
from csm.viewer.style import line_style, new_figure


def run(
    context: Context,
    *,
    source: Source | Bodies = "auto",
    descriptors: Sequence[str] = ("acd", "acd_paper", "hks"),
    checkpoints: Mapping[str, str] | None = None,
    strengths: Sequence[float] = (0.0, 0.05, 0.1, 0.2, 0.3, 0.5),
    n_pairs: int = 20,
    points: int = 300,
    distance: Method = "exact",
) -> Findings:
    """Match clean bodies onto noisy ones.

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
    strengths
        Standard deviations of each coordinate of the noise, in mean edge lengths.
    n_pairs, points, distance
        See `csm.studies.damage.Plan`.

    Raises
    ------
    ConfigError
        If there is no method or no strength, or a strength is negative.
    """
    if not strengths or min(strengths) < 0:
        raise ConfigError(f"figure12: strengths are numbers from 0, got {list(strengths)}")
    bodies = find_bodies(source, context)
    methods = contestants(descriptors, checkpoints, context, bodies)
    damages = {f"{strength:g}": partial(with_noise, strength=float(strength)) for strength in sorted(strengths)}
    rows = damage_rows(context, bodies, damages, methods, Plan(n_pairs, points, distance))
    path = context.out / "figure12.png"
    save_figure(path, _draw(rows, list(methods)))
    title = f"Matching onto noisy shapes ({bodies.title}), errors in thousandths of the diameter."
    notes = (
        f"{n_pairs} ordered pairs of the last twenty bodies, {points} points each, distance {distance} on the target "
        "without noise. Columns: standard deviation of the noise of each coordinate, in mean edge lengths of the "
        "target. ± is the standard error over targets.",
    )
    return Findings("figure12", title, ("method", *damages), by_method(rows), notes, (path,))


def _draw(rows: Sequence[Mapping[str, Any]], methods: Sequence[str]) -> Figure:
    figure, axes = new_figure(7.6, 4.0)
    for k, method in enumerate(methods):
        known = [row for row in rows if row["method"] == method and row["error"] is not None]
        strengths, errors = [float(row["damage"]) for row in known], [row["error"] for row in known]
        axes.plot(strengths, errors, marker="o", markersize=4, label=method, **line_style(k))
    axes.set_ylim(bottom=0)
    axes.set_xlabel("noise (mean edge lengths)")
    axes.set_ylabel(MEAN_ERROR)
    figure.legend(loc="outside right center", frameon=False)
    return figure
