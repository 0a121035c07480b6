"""``csm bench matching``: csm against pyFM and geomfum on the same pairs in one run: error, seconds and memory."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import metadata
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from csm._extras import install_line
from csm._progress import progress_bar
from csm._types import Arrays, IntArray
from csm.data.humans import humans_set
from csm.data.registry import find_set
from csm.data.shapes import Shape, ShapeSet
from csm.errors import ConfigError, DataError
from csm.evaluation.distances import MatchedPoints, target_errors
from csm.evaluation.protocol import EvaluationProtocol, Pair
from csm.reproduction.competitors import COMPETITORS, measure
from csm.reproduction.published import SETS
from csm.reproduction.study import Context, Findings, Study
from csm.reproduction.table1 import usable_pairs
from csm.viewer.comparisons import dots_figure

_log = logging.getLogger(__name__)

GOOD = 0.03
"""A pair whose mean error is below this fraction of the diameter is good."""

DISTRIBUTIONS = {"pyFM": "pyfmaps", "geomfum": "geomfum"}
"""Package that a competitor imports -> what it is called where it is installed from."""

HUMANS = "remeshed_5000"
"""Form of the built-in humans that is matched where no published set is found."""

_COLUMNS = ("set", "method", "mean error", "median error", "pairs below 30", "seconds", "ratio", "MB")


@dataclass(frozen=True, eq=False)
class Drawn:
    """A set and the pairs that are drawn of it."""

    title: str
    shapes: ShapeSet
    pairs: Sequence[Pair]


@dataclass(frozen=True)
class Peers(Study):
    """Errors, seconds and memory of csm and of its peers, pair by pair in turns.

    Parameters
    ----------
    sets
        Out of `csm.reproduction.published.SETS`; without any of their folders the built-in humans are taken.
    methods
        Out of `csm.reproduction.competitors.COMPETITORS`; those whose package is not installed are left out.
    sample
        How many pairs are drawn of each set.
    repeats
        How often each pair is matched by each method, of which the median counts.
    points
        Template points that are measured on each target, drawn.
    exact_points
        How many of these are measured exactly (see `csm.evaluation.distances`).
    """

    sets: tuple[str, ...] = tuple(SETS)
    methods: tuple[str, ...] = (
        *("acd", "acd_joint", "acd_multistart"),
        *("pyfm", "pyfm_readme", "geomfum", "geomfum_zoomout"),
    )
    sample: int = 10
    repeats: int = 1
    points: int = 500
    exact_points: int = 30

    def run(self, context: Context) -> Findings:
        """Match and measure; ConfigError if a set or method is unknown or a count is below 1."""
        self._require_sound()
        present = [name for name in self.methods if COMPETITORS[name].installed]
        absent = sorted(
            {COMPETITORS[name].package for name in self.methods} - {COMPETITORS[n].package for n in present}
        )
        for package in absent:
            _log.warning("%s", _missing(package))
        if not present:
            raise ConfigError(f"{self.name}: none of the methods can run; {' '.join(map(_missing, absent))}")
        drawn = self._drawn(context)
        tasks = [(of_set, pair) for of_set in drawn for pair in of_set.pairs]
        found: dict[str, list[dict[str, Any]]] = {of_set.title: [] for of_set in drawn}
        with progress_bar(tasks, desc="match", unit="pair") as bar:
            for of_set, pair in bar:
                bar.set_postfix_str(" -> ".join(pair))
                found[of_set.title].append(self._pair(context, of_set, pair, present))
        rows = [_row(title, name, pairs, present[0]) for title, pairs in found.items() for name in present]
        return self.findings(
            context,
            "Maps between two meshes by csm and by its peers: errors in thousandths of the diameter, and what a pair "
            "costs.",
            _COLUMNS,
            rows,
            [*self._notes(context, drawn, present, rows), *map(_missing, absent)],
            _picture(rows, present, list(found)),
        )

    def _require_sound(self) -> None:
        unknown = [*(n for n in self.sets if n not in SETS), *(n for n in self.methods if n not in COMPETITORS)]
        counts = (self.sample, self.repeats, self.points, self.exact_points)
        if unknown or not self.methods or min(counts) < 1:
            raise ConfigError(
                f"{self.name}: {', '.join(unknown) or 'no methods'}, counts {counts}; wanted sets out of "
                f"{', '.join(SETS)}, methods out of {', '.join(COMPETITORS)}, and counts from 1"
            )

    def _protocol(self, context: Context, pairs: Sequence[Pair]) -> EvaluationProtocol:
        return EvaluationProtocol(pairs, self.sample, self.points, context.seed, exact_points=self.exact_points)

    def _drawn(self, context: Context) -> list[Drawn]:
        drawn = []
        for key in self.sets:
            try:
                shapes = find_set(context.root, f"{key.upper()}_5k_remeshed")
            except DataError as error:
                _log.warning("%s is left out: %s", SETS[key], error)
                continue
            pairs = usable_pairs(key, shapes)
            names = list(dict.fromkeys(name for pair in pairs for name in pair))
            drawn.append(Drawn(SETS[key], shapes, self._protocol(context, pairs).choose(names)))
        if drawn:
            return drawn
        humans = humans_set(HUMANS, str(context.store.root))
        protocol = EvaluationProtocol(sample=self.sample, seed=context.seed)
        return [Drawn("built-in humans", humans, protocol.choose(humans.names))]

    def _pair(self, context: Context, of_set: Drawn, pair: Pair, methods: Sequence[str]) -> dict[str, Any]:
        """Match one pair by all methods, one after the other, and measure the maps together."""
        source, target = (of_set.shapes.load(name) for name in pair)
        surfaces = [(shape.mesh.vertices, shape.mesh.faces) for shape in (source, target)]
        runs: dict[str, list[Arrays]] = {name: [] for name in methods}
        failed: dict[str, str] = {}
        for _ in range(self.repeats):
            for name in methods:
                try:
                    runs[name].append(measure(name, *surfaces))
                except Exception as error:  # of another library, which is a result too
                    failed[name] = f"{type(error).__name__}: {error}"
                    _log.warning("%s -> %s by %s: %s", *pair, COMPETITORS[name].title, failed[name])
        maps = {name: made[0]["indices"] for name, made in runs.items() if name not in failed}
        errors = self._errors(context, source, target, maps)
        measured = {name: errors[name] | _cost(runs[name]) for name in maps}
        return {"pair": list(pair), "measured": measured, "failed": failed}

    def _errors(
        self, context: Context, source: Shape, target: Shape, maps: Mapping[str, IntArray]
    ) -> dict[str, dict[str, float]]:
        s, t = source.truth.as_template_to_shape(), target.truth.as_template_to_shape()
        protocol = self._protocol(context, [(source.name, target.name)])
        chosen = protocol.points_of(s, t)
        begin, truth = s.indices[chosen.template], t.indices[chosen.template]
        asked = [MatchedPoints(begin, truth, found[begin], chosen.exact, group=name) for name, found in maps.items()]
        made = target_errors(target.mesh, asked, protocol.distance_on(target.mesh), "diameter", context.store)
        diameter = made.lengths.diameter
        return {
            name: {
                "error": float(of.distance.mean()) / diameter,
                "worse than 0.1": float((of.distance > 0.1 * diameter).mean()),
            }
            for name, of in zip(maps, made.errors, strict=True)
        }

    def _notes(
        self, context: Context, drawn: Sequence[Drawn], present: Sequence[str], rows: Sequence[dict[str, Any]]
    ) -> list[str]:
        pairs = "; ".join(f"{len(of_set.pairs)} of {of_set.title}" for of_set in drawn)
        failed = [f"{row['method']} on {row['failures']} of {row['set']}" for row in rows if row["failures"]]
        return [
            f"Pairs, the same for all methods, drawn with seed {context.seed}: {pairs}. Their error is the mean over "
            f"{self.points} drawn template points known on both shapes, of which {self.exact_points} are measured "
            "exactly and the others by scaled paths along edges. The table has mean and median over pairs, and the "
            f"share of pairs below {1000 * GOOD:.0f}.",
            "Seconds are those of the processor from the arrays of two meshes to the map: with all eigenproblems, "
            f"without imports; medians over pairs of the medians of {self.repeats}. Methods take turns pair by pair, "
            "each in a fresh process of one thread in which nothing is kept from before. MB is the peak of that "
            f"process with its libraries. Ratios are to {COMPETITORS[present[0]].title}.",
            *(f"{COMPETITORS[name].title}: {COMPETITORS[name].settings}." for name in present),
            *_versions(present),
            *([f"Failed, and left out of that row: {'; '.join(failed)}."] if failed else []),
        ]


def _versions(methods: Sequence[str]) -> list[str]:
    packages = {COMPETITORS[name].package for name in methods}
    found = [f"{name} {metadata.version(name)}" for package, name in DISTRIBUTIONS.items() if package in packages]
    return [f"Versions: {', '.join(found)}."] if found else []


def _missing(package: str) -> str:
    name = DISTRIBUTIONS.get(package, package)
    return f"{name} is not installed, so its rows are left out ({install_line('peers')})."


def _cost(runs: Sequence[Arrays]) -> dict[str, float]:
    """Return the medians of what `csm.reproduction.competitors.measure` measured."""
    return {key: float(np.median([run[key] for run in runs])) for key in ("wall", "cpu", "before", "peak")}


def _row(title: str, name: str, pairs: Sequence[dict[str, Any]], reference: str) -> dict[str, Any]:
    of = {kind: [p["measured"][kind] for p in pairs if kind in p["measured"]] for kind in (name, reference)}
    errors = np.array([each["error"] for each in of[name]])
    seconds, first = (np.array([each["cpu"] for each in of[kind]]) for kind in (name, reference))
    peaks = np.array([each["peak"] for each in of[name]])
    known = len(errors) > 0
    return {
        "set": title,
        "method": COMPETITORS[name].title,
        "mean error": round(1000 * float(errors.mean()), 1) if known else None,
        "median error": round(1000 * float(np.median(errors)), 1) if known else None,
        "pairs below 30": f"{100 * float((errors < GOOD).mean()):.0f} %" if known else None,
        "seconds": float(np.median(seconds)) if known else None,
        "ratio": float(np.median(seconds) / np.median(first)) if known and len(first) else None,
        "MB": round(float(np.median(peaks))) if known and np.isfinite(peaks).all() else None,
        "name": name,
        "settings": COMPETITORS[name].settings,
        "failures": len(pairs) - len(errors),
        "pairs": [
            {"pair": p["pair"], **p["measured"].get(name, {})}
            | ({"failed": p["failed"][name]} if name in p["failed"] else {})
            for p in pairs
        ],
    }


def _picture(rows: Sequence[dict[str, Any]], names: Sequence[str], sets: Sequence[str]) -> Figure:
    labels = {"mean error": "mean error (thousandths of the diameter)", "seconds": "seconds", "MB": "peak memory (MB)"}
    panels = {
        label: {
            title: [float("nan") if row[key] is None else float(row[key]) for row in rows if row["set"] == title]
            for title in sets
        }
        for key, label in labels.items()
    }
    return dots_figure([COMPETITORS[name].title for name in names], panels)
