"""Figure 3 and what guesses are worth: settings of descriptors compared on pairs of training shapes.

Figure 3 has the error of matching by ACD over each of its parameters, with the others at a preset.  All settings of a
shape share its eigenproblems, and finished targets are kept, so a longer list of values costs only the new ones.  For
the same reason a Hydra multirun over single settings fills the same targets, since its jobs share the folder, and one
run over all values then draws them in one picture::

    csm reproduce figure3 -m 'figure3.alphas=[1],[5],[10]' 'figure3.ks=[10],[70]'
    csm reproduce figure3

Where a rank of Table 1 differs from the paper's, `Assumptions` tells whether another reading of the descriptor, where
no source says how it is meant, would explain it; no row of a table is chosen by it.
"""

from __future__ import annotations

import logging
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np

from csm.data.humans import humans_set
from csm.data.registry import find_set
from csm.data.shapes import ShapeSet
from csm.descriptors.acd import ACD
from csm.descriptors.base import Descriptor
from csm.descriptors.presets import preset
from csm.descriptors.wft import WFT
from csm.errors import ConfigError, DataError
from csm.evaluation.protocol import Pair
from csm.matching.methods import DescriptorMethod
from csm.reproduction.published import AGE, family, label
from csm.reproduction.study import MEAN_ERROR, NO_OPTION, Context, Findings, OnPoints
from csm.viewer.comparisons import Sweep, dots_figure, sweeps_figure

PERSONS, POSES = 8, 10
"""Of the training shapes, which come person by person: shapes 0 to 79 of FAUST."""

K = TypeVar("K", bound=Hashable)
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class _OnTrainingPairs(OnPoints):
    """A study that compares settings on pairs of training shapes; no test shape is used.

    Parameters
    ----------
    shapes
        The shapes; by default remeshed FAUST if it is below the root of the data, else remeshed built-in humans.
    n_pairs
        Ordered pairs of two poses of one person, spread over the persons; even, as pairs are measured both ways.
    """

    shapes: ShapeSet | None = field(default=None, metadata=NO_OPTION)
    n_pairs: int = 16
    points: int = 250

    def shape_set(self, context: Context) -> ShapeSet:
        """Return the shapes."""
        if self.shapes is not None:
            return self.shapes
        try:
            return find_set(context.root, "FAUST_5k_remeshed")
        except DataError as error:
            _log.info("the built-in humans are taken: %s", error)
            return humans_set("remeshed_5000", str(context.store.root))

    def errors(self, context: Context, settings: Mapping[K, Descriptor]) -> dict[K, dict[str, Any]]:
        """Return the numbers of each setting for a table: error, standard error, and the error of each pair."""
        shapes = self.shape_set(context)
        pairs = same_person_pairs(shapes.names, self.n_pairs, context.seed)
        different = list(dict.fromkeys(settings.values()))
        methods = [DescriptorMethod(setting, str(i)) for i, setting in enumerate(different)]
        found = self.evaluate(context, methods, shapes, pairs)
        errors = {d: 1000 * np.array([row.age for row in e.rows]) for d, e in zip(different, found, strict=True)}
        return {
            key: {
                "error": float(errors[setting].mean()),
                "standard error": float(errors[setting].std(ddof=1) / np.sqrt(len(pairs))),
                "pairs": errors[setting].tolist(),
            }
            for key, setting in settings.items()
        }

    def note(self, ending: str) -> str:
        """Return a sentence on the protocol: pairs, points, distance and unit."""
        return (
            f"error: mean over {self.n_pairs} ordered pairs of {self.points} points each, in thousandths of the "
            f"target's geodesic diameter ({self.distance} distances); {ending}"
        )


@dataclass(frozen=True)
class Figure3(_OnTrainingPairs):
    """The mean error of all settings that differ from a preset in one parameter.

    Parameters
    ----------
    base
        Preset of ACD that gives the other parameters.
    alphas, angles, ks, orders
        Values of alpha, J, K and D.  Angle counts that divide each other share eigenproblems.
    """

    base: str = "acd_paper"
    alphas: tuple[float, ...] = (0, 1, 2, 5, 10, 20, 50, 100)
    angles: tuple[int, ...] = (1, 2, 4, 5, 10, 20, 40)
    ks: tuple[int, ...] = (5, 10, 20, 40, 70, 100)
    orders: tuple[int, ...] = (1, 2, 4, 6, 8, 12, 16)

    def run(self, context: Context) -> Findings:
        """Measure and draw; ConfigError if `base` is no preset of ACD or a value is out of range."""
        centre = preset(self.base)
        if not isinstance(centre, ACD):
            raise ConfigError(f"{self.name}: {self.base} is not a preset of ACD, whose parameters are studied")
        values = {"alpha": self.alphas, "angles": self.angles, "k": self.ks, "order": self.orders}
        labels = {"alpha": "strength α", "angles": "angles J", "k": "eigenpairs K", "order": "order D"}
        settings = {(name, value): vary(centre, name, value) for name in values for value in sorted(values[name])}
        errors = self.errors(context, settings)
        rows = [
            {"parameter": name, "value": value, "columns": len(setting.columns), **errors[name, value]}
            for (name, value), setting in settings.items()
        ]
        sweeps = [
            _sweep(text, [row for row in rows if row["parameter"] == name], getattr(centre, name))
            for name, text in labels.items()
        ]
        where = self.shape_set(context).name
        return self.findings(
            context,
            f"Error of nearest-neighbour matching by ACD over its parameters, others as in {self.base} ({where}).",
            ("parameter", "value", "columns", "error", "standard error"),
            rows,
            (
                self.note("bars: one standard error over pairs."),
                f"Pairs: two poses of one of the first {PERSONS} persons, both ways; no test shape is used.",
                "At alpha 0 all angles give the same numbers, so a single one is used.",
            ),
            sweeps_figure(sweeps, MEAN_ERROR),
        )


def vary(centre: ACD, name: str, value: float) -> ACD:
    """Return the setting with one parameter replaced; at alpha 0 all angles are alike, so one is left."""
    if name == "alpha":
        return replace(centre, alpha=float(value), angles=centre.angles if value else 1)
    changes: dict[str, Any] = {name: int(value)}
    return replace(centre, **changes)


def _sweep(text: str, rows: Sequence[dict[str, Any]], preset_value: float) -> Sweep:
    means, bars = (np.array([row[key] for row in rows]) for key in ("error", "standard error"))
    return Sweep(text, [row["value"] for row in rows], {"error": (means, bars)}, preset_value)


_WFT_FUNCTIONS = WFT().functions
VARIANTS: Mapping[str, Mapping[str, Mapping[str, Any]]] = {
    "wft": {
        "columns over area": {"normalise": "area"},
        "splines centred": {"spline_shift": 2.0},
        # Heat and wave signature 80 of 100.
        "kernels counted from the end": {"functions": tuple(name.replace("80", "21") for name in _WFT_FUNCTIONS)},
        "K = 100": {"k": 100},
        "K = 300": {"k": 300},
        "geometry vectors only": {"functions": tuple(n for n in _WFT_FUNCTIONS if n.startswith("geovec"))},
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
"""Preset -> what is chosen otherwise than in Table 1, where no source says what is right -> the parameters for it."""

AS_IN_TABLE = "as in table1"


@dataclass(frozen=True)
class Assumptions(_OnTrainingPairs):
    """Every variant of the descriptors beside what Table 1 takes.

    Parameters
    ----------
    descriptors
        Out of `VARIANTS`.
    """

    descriptors: tuple[str, ...] = tuple(VARIANTS)

    def run(self, context: Context) -> Findings:
        """Measure and draw; ConfigError if a descriptor has no variants."""
        unknown = [name for name in self.descriptors if name not in VARIANTS]
        if unknown or not self.descriptors:
            missing = ", ".join(unknown) or "nothing"
            raise ConfigError(f"{self.name}: {missing} to vary; there is {', '.join(VARIANTS)}")
        variants = {(name, title): d for name in self.descriptors for title, d in variants_of(name).items()}
        rows = [
            {"descriptor": name, "variant": title, "paper": AGE[family(name)]["faust"], **errors}
            for (name, title), errors in self.errors(context, variants).items()
        ]
        names = [f"{label(name)}: {title}" if title != AS_IN_TABLE else label(name) for name, title in variants]
        return self.findings(
            context,
            f"Errors when what the sources leave open is chosen otherwise ({self.shape_set(context).name}).",
            ("descriptor", "variant", "paper", "error", "standard error"),
            rows,
            (
                self.note(f"two poses of one of the first {PERSONS} persons, both ways; no test shape."),
                "paper: the error in its Table 1 on 100 other pairs of poses of one person each.",
            ),
            dots_figure(names, {MEAN_ERROR: {"": [row["error"] for row in rows]}}),
        )


def variants_of(name: str) -> dict[str, Descriptor]:
    """Return a preset and its variants by what differs, the preset first."""
    return {title: preset(name, **changes) for title, changes in [(AS_IN_TABLE, {}), *VARIANTS[name].items()]}


def same_person_pairs(names: Sequence[str], n_pairs: int, seed: int) -> list[Pair]:
    """Return ordered pairs of poses, both ways, spread evenly over the persons; no shape twice while there are others.

    The names are those of all shapes, person by person; only those of the training persons are used.  ConfigError if
    `n_pairs` is odd, not positive, or more than there are.

    Examples
    --------
    >>> same_person_pairs([str(i) for i in range(100)], 4, seed=0)
    [('4', '6'), ('6', '4'), ('12', '19'), ('19', '12')]
    """
    people = [names[start : start + POSES] for start in range(0, PERSONS * POSES, POSES)]
    most = sum(2 * (len(poses) // 2) for poses in people)
    if n_pairs < 2 or n_pairs % 2 or n_pairs > most:
        raise ConfigError(f"n_pairs={n_pairs}; wanted an even number from 2 to {most}")
    rng = np.random.default_rng(seed)
    shuffled = [[poses[i] for i in rng.permutation(len(poses))] for poses in people if len(poses) >= 2]
    couples = [poses[turn : turn + 2] for turn in range(0, POSES, 2) for poses in shuffled]
    return [pair for c in couples if len(c) == 2 for pair in ((c[0], c[1]), (c[1], c[0]))][:n_pairs]
