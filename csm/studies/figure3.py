"""Figure 3: the error of matching by ACD over each of its parameters, with the others at a preset.

All settings of one pair of shapes are measured together, because they share eigenproblems: the spectrum of a strength
and an angle is computed once, with the greatest K that any setting asks for, and cut.  What a pair has measured is kept
in ``figure3/`` of the folder of artefacts, so a killed study is started again and a longer list of values costs only
the new ones.  For the same reason a Hydra multirun over single settings fills the same cells, since its jobs share the
folder, and one run over all values then draws them in one picture::

    csm reproduce figure3 -m '+figure3.alphas=[1],[5],[10]' '+figure3.ks=[10],[70]'
    csm reproduce figure3

Only training shapes are used: persons 0 to 7 of FAUST, shapes 0 to 79.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from csm._types import FloatArray
from csm.data.shapeset import ShapeSet
from csm.descriptors.acd import ACD
from csm.descriptors.presets import preset
from csm.errors import ConfigError
from csm.operators.geodesic import Method
from csm.studies.couples import PERSONS, averaged, training_errors, training_shapes
from csm.studies.study import MEAN_ERROR, Context, Findings
from csm.viewer.comparisons import Sweep, sweeps_figure
from csm.viewer.figures import save_figure

LABELS = {"alpha": "strength α", "angles": "angles J", "k": "eigenpairs K", "order": "order D"}


def run(
    context: Context,
    *,
    shapes: ShapeSet | None = None,
    base: str = "acd_paper",
    alphas: Sequence[float] = (0, 1, 2, 5, 10, 20, 50, 100),
    angles: Sequence[int] = (1, 2, 4, 5, 10, 20, 40),
    ks: Sequence[int] = (5, 10, 20, 40, 70, 100),
    orders: Sequence[int] = (1, 2, 4, 6, 8, 12, 16),
    n_pairs: int = 16,
    points: int = 250,
    distance: Method = "exact",
) -> Findings:
    """Measure the mean error of all settings that differ from the preset in one parameter, and draw it.

    Parameters
    ----------
    context
        Where data and artefacts are.
    shapes
        The shapes; by default remeshed FAUST if it is below the root of the data, else remeshed built-in humans.
    base
        Preset of ACD that gives the other parameters.
    alphas, angles, ks, orders
        Values of alpha, J, K and D.  Angle counts that divide each other share eigenproblems.
    n_pairs
        Ordered pairs of two poses of one person, spread over the persons; even, as pairs are measured both ways.
    points
        Points measured per pair, drawn without replacement.
    distance
        Kind of geodesic distance of the errors.

    Raises
    ------
    ConfigError
        If `base` is no preset of ACD, a value is out of range or `n_pairs` is not an even number from 2.
    """
    sweeps = {"alpha": alphas, "angles": angles, "k": ks, "order": orders}
    centre = preset(base)
    if not isinstance(centre, ACD):
        raise ConfigError(f"figure3: {base} is not a preset of ACD, whose parameters are studied")
    wanted = {name: [vary(centre, name, value) for value in sorted(values)] for name, values in sweeps.items()}
    shapes = shapes or training_shapes(context)
    settings = [setting for values in wanted.values() for setting in values]
    errors = training_errors(context, shapes, settings, "figure3", n_pairs=n_pairs, points=points, distance=distance)
    rows = [
        _row(name, value, setting, errors[setting])
        for name, values in sweeps.items()
        for value, setting in zip(sorted(values), wanted[name], strict=True)
    ]
    path = context.out / "figure3.png"
    save_figure(path, sweeps_figure([_sweep(name, rows, centre) for name in sweeps], MEAN_ERROR))
    title = f"Error of nearest-neighbour matching by ACD over its parameters, others as in {base} ({shapes.name})."
    shown = ("parameter", "value", "columns", "error", "standard error")
    return Findings("figure3", title, shown, rows, _notes(n_pairs, points, distance), (path,))


def vary(centre: ACD, name: str, value: float) -> ACD:
    """Return the setting with one parameter replaced; at alpha 0 all angles are alike, so one is left."""
    if name == "alpha":
        return replace(centre, alpha=float(value), angles=centre.angles if value else 1)
    changes: dict[str, Any] = {name: int(value)}
    return replace(centre, **changes)


def _row(name: str, value: float, setting: ACD, errors: FloatArray) -> dict[str, Any]:
    """Return what is written of one setting, from its errors over ordered pairs in thousandths."""
    return {
        "parameter": name,
        "value": value,
        "columns": len(setting.columns),
        **averaged(errors),
    }


def _sweep(name: str, rows: Sequence[dict[str, Any]], centre: ACD) -> Sweep:
    mine = [row for row in rows if row["parameter"] == name]
    return Sweep(
        LABELS[name],
        [row["value"] for row in mine],
        {"error": (np.array([row["error"] for row in mine]), np.array([row["standard error"] for row in mine]))},
        getattr(centre, name),
    )


def _notes(n_pairs: int, points: int, distance: str) -> tuple[str, ...]:
    return (
        f"error: mean over {n_pairs} ordered pairs of {points} points each, in thousandths of the target's "
        f"geodesic diameter ({distance} distances); bars: one standard error over pairs.",
        f"Pairs: two poses of one of the first {PERSONS} persons, both ways; no test shape is used.",
        "At alpha 0 all angles give the same numbers, so a single one is used.",
    )
