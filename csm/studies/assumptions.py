"""What the guesses are worth: matching errors when what no source says of a descriptor is chosen otherwise.

Where a rank of Table 1 differs from the paper's, this tells whether another reading of the descriptor would explain it.
Only training shapes are used, as for Figure 3, and no row of a table is chosen by it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from csm._types import FloatArray
from csm.data.shapeset import ShapeSet
from csm.descriptors.base import Descriptor
from csm.descriptors.presets import preset
from csm.descriptors.wft import WFT
from csm.errors import ConfigError
from csm.operators.geodesic import Method
from csm.studies.bodies import label
from csm.studies.couples import PERSONS, averaged, training_errors, training_shapes
from csm.studies.published import AGE, family
from csm.studies.study import MEAN_ERROR, Context, Findings
from csm.viewer.comparisons import dots_figure
from csm.viewer.figures import save_figure

_FUNCTIONS = WFT().functions
_FROM_THE_END = tuple(name.replace("80", "21") for name in _FUNCTIONS)
"""Heat and wave signature 80 of 100 counted from the other end."""

VARIANTS: Mapping[str, Mapping[str, Mapping[str, Any]]] = {
    "wft": {
        "columns over area": {"normalise": "area"},
        "splines centred": {"spline_shift": 2.0},
        "kernels counted from the end": {"functions": _FROM_THE_END},
        "K = 100": {"k": 100},
        "K = 300": {"k": 300},
        "geometry vectors only": {"functions": tuple(name for name in _FUNCTIONS if name.startswith("geovec"))},
    },
    "awft": {"columns over area": {"normalise": "area"}, "splines centred": {"spline_shift": 2.0}},
    "asmwd": {"K = 300": {"k": 300}},
    "smwd": {
        "Mexican hats": {"variant": "mexican"},
        "K = 300": {"k": 300},
        "rows as they are": {"normalise": False},
        "6 filters": {"n_filters": 6},
        "20 filters": {"n_filters": 20},
    },
    "dep": {
        "2 scales": {"n_scales": 2},
        "c = 0.5": {"c": 0.5},
        "c = 0.9": {"c": 0.9},
        "distance by heat": {"distance": "heat"},
        "biharmonic distance": {"distance": "biharmonic"},
        "largest scale 0.3": {"largest": 0.3},
    },
    "amks": {
        "unit area": {"units": "unit_area"},
        "T = 0.01": {"time": 0.01},
        "T = 5": {"time": 5.0},
        "K = 300": {"k": 300},
    },
    "hks": {"unscaled": {"scaled": False}, "K = 100": {"k": 100}},
    "wks": {"functional-map convention": {"variant": "functional_map"}, "K = 100": {"k": 100}},
}
"""Preset -> what is chosen otherwise -> the parameters that say so."""

AS_IN_TABLE = "as in table1"


def run(
    context: Context,
    *,
    shapes: ShapeSet | None = None,
    descriptors: Sequence[str] = tuple(VARIANTS),
    n_pairs: int = 16,
    points: int = 250,
    distance: Method = "exact",
) -> Findings:
    """Measure every variant of the descriptors beside what Table 1 takes.

    Parameters
    ----------
    context
        Where data and artefacts are; what was measured of a couple is kept in ``assumptions/``.
    shapes
        The shapes; by default those of `csm.studies.couples.training_shapes`.
    descriptors
        Out of `VARIANTS`.
    n_pairs
        Ordered pairs of two poses of one person, spread over the persons; even, as pairs are measured both ways.
    points
        Points measured per pair, drawn without replacement.
    distance
        Kind of geodesic distance of the errors.

    Raises
    ------
    ConfigError
        If a descriptor has no variants or `n_pairs` is not an even number from 2.
    """
    unknown = [name for name in descriptors if name not in VARIANTS]
    if unknown or not descriptors:
        raise ConfigError(f"assumptions: {', '.join(unknown) or 'nothing'} to vary; there is {', '.join(VARIANTS)}")
    shapes = shapes or training_shapes(context)
    wanted = {(name, title): d for name in descriptors for title, d in variants_of(name).items()}
    settings = list(wanted.values())
    errors = training_errors(
        context, shapes, settings, "assumptions", n_pairs=n_pairs, points=points, distance=distance
    )
    rows = [_row(name, title, errors[descriptor]) for (name, title), descriptor in wanted.items()]
    names = [f"{label(name)}: {title}" if title != AS_IN_TABLE else label(name) for name, title in wanted]
    path = context.out / "assumptions.png"
    save_figure(path, dots_figure(names, {MEAN_ERROR: {"": [row["error"] for row in rows]}}))
    notes = (
        f"error: mean over {n_pairs} ordered pairs of {points} points each, in thousandths of the target's geodesic "
        f"diameter ({distance} distances); two poses of one of the first {PERSONS} persons, both ways; no test shape.",
        "paper: the error in its Table 1 on 100 other pairs of poses of one person each.",
    )
    title = f"Errors when what the sources leave open is chosen otherwise ({shapes.name})."
    return Findings("assumptions", title, ("descriptor", "variant", "paper", *_NUMBERS), rows, notes, (path,))


_NUMBERS = ("error", "standard error")


def variants_of(name: str) -> dict[str, Descriptor]:
    """Return a preset and its variants by what differs, the preset first."""
    changed = {title: preset(name, **changes) for title, changes in VARIANTS[name].items()}
    return {AS_IN_TABLE: preset(name), **changed}


def _row(name: str, title: str, errors: FloatArray) -> dict[str, Any]:
    return {
        "descriptor": name,
        "variant": title,
        "paper": AGE[family(name)]["faust"],
        **averaged(errors),
    }
