"""What refinement is worth: matchers alone and followed by refiners, on the pairs of Table 1 and across resolutions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from csm.data.registry import find_set
from csm.errors import ConfigError, DataError
from csm.evaluation.metrics import far_rate
from csm.evaluation.protocol import EvaluationProtocol, Pair
from csm.evaluation.results import Evaluation
from csm.matching.methods import Method
from csm.reproduction.published import SETS
from csm.reproduction.study import Context, Findings, Study
from csm.reproduction.table1 import usable_pairs
from csm.viewer.comparisons import curve_panels
from csm.viewer.figures import Curve

TESTED = 20
"""Shapes at the end of a set with one connectivity that are paired with each other: 80 to 99 of FAUST."""

TUNED_ON = ("cat", "dog", "wolf")
"""TOSCA's classes that refiners were tuned on."""

GOOD = 0.03
"""Mean error, a fraction of the diameter, below which a pair counts as good."""


@dataclass(frozen=True)
class Refinement(Study):
    """The errors of a method with and without refinement.

    Parameters
    ----------
    sets
        "faust", "shrec19" and "tosca" are the columns of Table 1; any other name is that of a set with one
        connectivity, such as "FAUST_15000", whose last twenty shapes are all paired.
    descriptors
        Names of presets; none with "none" alone.
    checkpoints
        Name -> file of trained networks.
    refine
        The refiners; "none" for the nearest neighbours alone.
    points
        How many template points are measured, drawn; None for all.
    exact_points
        How many of these are measured exactly on each shape, as in Table 1; None for all.
    sample
        How many pairs of a set are drawn; None for all.
    """

    sets: tuple[str, ...] = tuple(SETS)
    descriptors: tuple[str, ...] = ("acd",)
    checkpoints: Mapping[str, str] | None = None
    refine: tuple[str, ...] = ("none", "zoomout", "joint", "multistart")
    points: int | None = None
    exact_points: int | None = 100
    sample: int | None = None

    def run(self, context: Context) -> Findings:
        """Match and measure what is missing."""
        if not self.sets or not self.refine:
            raise ConfigError(f"{self.name}: wanted some sets and some of refine")
        methods = self._methods()
        cells = {key: self._evaluate(context, methods, key) for key in self.sets}
        titles = {key: SETS.get(key, key.replace("_", " ")) for key in self.sets}
        rows = [
            _row(method, matcher, {titles[key]: found[method, matcher] for key, found in cells.items()})
            for method, matcher in next(iter(cells.values()))
        ]
        curves = {
            titles[key]: {
                f"{method}, {matcher}": Curve(e.thresholds, e.cqc, e.summary["age"])
                for (method, matcher), e in of_set.items()
            }
            for key, of_set in cells.items()
        }
        columns = [f"{title}{what}" for title in titles.values() for what in ("", " good %", " far %", " unseen")]
        columns = [column for column in columns if any(column in row for row in rows)]
        points = "all" if self.points is None else f"{self.points} drawn"
        exact = (
            "exact geodesic distances"
            if self.exact_points is None
            else f"exact geodesic distances at {self.exact_points} points of a target and scaled edge paths at others"
        )
        notes = [
            f"Mean error over {points} template points, {exact}, in thousandths of the diameter. Good: pairs with a "
            f"mean below {1000 * GOOD:g}. Far: points farther than 0.1 from the truth.",
            *(f"{titles[key]}: {len(next(iter(found.values())).rows)} pairs." for key, found in cells.items()),
            "FAUST: pairs of two poses of one person. Refiners and their constants were chosen on FAUST 0 to 79 and on "
            "TOSCA's cats, dogs and wolves, which are among the pairs of the columns FAUST and TOSCA, as in Table 1; "
            "columns called unseen have the mean over the other pairs.",
        ]
        title = "Maps before and after refinement, no training but of networks that are named."
        return self.findings(context, title, ("method", "map", *columns), rows, notes, curve_panels(curves))

    def _methods(self) -> list[Method | str]:
        names = [] if tuple(self.descriptors) == ("none",) else list(self.descriptors)
        found: list[Method | str] = [*names]
        if self.checkpoints:
            from csm.matching.network import load_model

            found += [load_model(path, name) for name, path in self.checkpoints.items()]
        if not found:
            raise ConfigError(f"{self.name}: name a descriptor, or a checkpoint as checkpoints={{NAME:PATH}}")
        return found

    def _evaluate(self, context: Context, methods: list[Method | str], key: str) -> dict[tuple[str, str], Evaluation]:
        shapes = find_set(context.root, f"{key.upper()}_5k_remeshed" if key in SETS else key)
        pairs = usable_pairs(key, shapes) if key in SETS else _last(shapes.names)
        protocol = EvaluationProtocol(pairs, self.sample, self.points, context.seed, exact_points=self.exact_points)
        found = context.evaluate(methods, shapes, protocol, refine=list(self.refine), skip_failures=True)
        if failed := [f"{e.method}, {e.matcher}: {e.failures}" for e in found if not e.rows]:
            raise DataError(f"{shapes.name}: none of the pairs could be measured by {'; '.join(failed)}")
        return {(e.method, e.matcher): e for e in found}


def _last(names: tuple[str, ...]) -> list[Pair]:
    tested = names[-TESTED:]
    return [(a, b) for a in tested for b in tested if a != b]


def _tuned_on(title: str, name: str) -> bool:
    """Tell whether refiners were tuned on a shape of a column of Table 1."""
    if title == SETS["faust"]:
        return int(name[-3:]) < 80
    return title == SETS["tosca"] and name.startswith(TUNED_ON)


def _row(method: str, matcher: str, cells: Mapping[str, Evaluation]) -> dict[str, Any]:
    row: dict[str, Any] = {"method": method, "map": matcher}
    for title, e in cells.items():
        pairs = np.array([pair.age for pair in e.rows])
        row[title] = round(1000 * e.summary["age"], 1)
        row[f"{title} good %"] = round(100 * float((pairs < GOOD).mean()))
        row[f"{title} far %"] = round(100 * far_rate(e.errors), 2)
        unseen = np.array([not (_tuned_on(title, pair.source) or _tuned_on(title, pair.target)) for pair in e.rows])
        if unseen.any() and not unseen.all():
            row[f"{title} unseen"] = round(1000 * float(pairs[unseen].mean()), 1)
        row[f"{title} summary"] = {
            **{name: None if np.isnan(value) else value for name, value in e.summary.items()},
            "median": float(np.median(e.errors)),
            "worst pair": float(pairs.max()),
            "failures": dict(e.failures),
        }
    return row
