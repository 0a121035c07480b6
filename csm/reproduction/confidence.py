"""How far confidence can be believed: fitted on pairs of training shapes, tried on pairs of other shapes.

Pairs are whole shapes of one template, such with a part of the source or of the target cut away, and shapes of
different kinds, in which no vertex has a partner.  A match is right if it is within 0.155 times the square root of the
target's area of the true vertex (a tenth of a human's geodesic diameter).
"""

from __future__ import annotations

import itertools
import json
import logging
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np

from csm._parallel import n_processes, parallel_map
from csm._types import BoolArray, FloatArray, IntArray
from csm.data.folders import FolderSet
from csm.data.registry import find_set
from csm.data.shapes import Shape
from csm.data.store import Store
from csm.errors import ConfigError
from csm.matching.base import Described
from csm.matching.calibration import Calibration, calibration, fit_calibration
from csm.matching.confidence import refined_probability
from csm.matching.maps import VertexMap
from csm.matching.methods import as_method
from csm.matching.refinement.registry import refiner
from csm.matching.registry import matcher
from csm.matching.signals import OF_MAPS, OF_REFINED, Sides, map_signals, spectral_signals
from csm.mesh.io import atomic_path
from csm.mesh.perturb import Damaged
from csm.operators.geodesic import geodesics
from csm.reproduction.methods_on_bodies import cut_extremity
from csm.reproduction.study import Context, Findings, Study
from csm.viewer.comparisons import reliability_figure

_log = logging.getLogger(__name__)

RIGHT = 0.155
"""Distance, in units of the square root of the target's area, within which a match is right."""

NEAREST = "nearest"
"""The name of no refinement in results."""

CUTS = (0.1, 0.3, 0.5)
"""Shares of the area that are cut away, in turn."""

TRAINING_CLASSES = ("cat", "dog", "wolf")


class Asked(NamedTuple):
    """A pair of shapes: the set and the name of each, and what is done to them.

    `kind` is "whole", "source cut", "target cut" or "other kinds"; `cut` the share that is cut away.
    """

    source: tuple[str, str]
    target: tuple[str, str]
    kind: str
    cut: float = 0.0


@dataclass(frozen=True, eq=False)
class Seen:
    """What was seen of a pair by one refinement: signals of points, shape (P, S), and whether each match is right."""

    kind: str
    refine: str
    signals: FloatArray
    right: BoolArray


@dataclass(frozen=True)
class ConfidenceStudy(Study):
    """The reliability of confidence, and its calibration.

    Parameters
    ----------
    descriptor
        Name of a preset.
    pairs
        How many pairs of whole shapes of each set are drawn; half as many with cuts, and of different kinds.
    points
        How many points of each pair.
    refine
        The refinements that are tried; "joint", which often fails, serves the fit as an example of wrong maps.
    fit
        Whether training shapes are used (FAUST 0 to 79, TOSCA's cats, dogs and wolves) and the calibrations are fitted
        and written to ``calibration.json`` in the folder of the artefacts; else all others are, and SHREC'19.
    """

    descriptor: str = "acd"
    pairs: int = 24
    points: int = 300
    refine: tuple[str, ...] = (NEAREST, "joint", "multistart")
    fit: bool = False

    def run(self, context: Context) -> Findings:
        """Match the pairs, compare confidence with the truth, and fit if that is asked for."""
        asked = draw_pairs(context, self.pairs, training=self.fit)
        look = partial(_look, str(context.root), str(context.store.root), self)
        processes = n_processes(context.workers, len(asked))
        done = parallel_map(look, asked, _label, processes, what="match", unit="pair", total=len(asked))
        seen = list(itertools.chain.from_iterable(done))
        known = {kind: calibration(kind) for kind in ("map", "refined")} if not self.fit else fitted(seen)
        if self.fit:
            with atomic_path(context.out / "calibration.json") as temporary:
                temporary.write_text(json.dumps(_record(known, self, len(asked)), indent=1) + "\n", encoding="utf-8")
        rows = [_row(name, kind, some, known) for (name, kind), some in _groups(seen).items()]
        curves = {name: _curve(known, [s for s in seen if s.refine == name]) for name in self.refine}
        which = "training shapes, which it was fitted on" if self.fit else "shapes that it was not fitted on"
        title = f"Confidence against the truth, {len(asked)} pairs of {which}, by {self.descriptor}."
        notes = (
            f"{self.points} drawn points of each pair, heat distances. Right: within {RIGHT:g} sqrt(area) of the "
            "truth. Caught: share of all wrong matches that is among the fifth of the points with least confidence, "
            "beside the most that a fifth can hold. Brier: mean squared difference of confidence and truth (0 or 1).",
        )
        columns = ("map", "pairs", "count", "wrong %", "caught %", "at most %", "mean confidence %", "Brier")
        return self.findings(context, title, columns, rows, notes, reliability_figure(curves))


def draw_pairs(context: Context, count: int, *, training: bool) -> list[Asked]:
    """Draw pairs of whole shapes of each set, pairs with cuts, and pairs of different kinds."""
    rng = np.random.default_rng(context.seed)
    asked: list[Asked] = []
    for key in ("FAUST", "TOSCA", *([] if training else ["SHREC19"])):
        pairs = _pairs_of(find_set(context.root, f"{key}_5k_remeshed"), key, training)
        drawn = [pairs[i] for i in rng.permutation(len(pairs))[: count + count // 2]]
        asked += [Asked((key, a), (key, b), "whole") for a, b in drawn[:count]]
        for i, (a, b) in enumerate(drawn[count:]):
            asked.append(Asked((key, a), (key, b), ("source cut", "target cut")[i % 2], CUTS[i % len(CUTS)]))
    humans, animals = ([a for a in asked if a.source[0] == key and a.kind == "whole"] for key in ("FAUST", "TOSCA"))
    for i, (one, other) in enumerate(zip(humans[: count // 2], _animals(animals), strict=False)):
        both = one.source, other.source
        asked.append(Asked(*(both if i % 2 else both[::-1]), "other kinds"))
    return asked


def _animals(asked: Sequence[Asked]) -> list[Asked]:
    """Leave out TOSCA's humans and half-humans."""
    people = ("david", "michael", "victoria", "centaur", "gorilla")
    return [one for one in asked if not one.source[1].startswith(people)]


def _pairs_of(shapes: FolderSet, key: str, training: bool) -> list[tuple[str, str]]:
    if key == "SHREC19":
        return list(shapes.mapped_pairs)
    templates = shapes.templates
    names = list(templates)
    if key == "FAUST":
        names = names[:80] if training else names[80:]
    else:
        names = [name for name in names if name.startswith(TRAINING_CLASSES) == training]
    return [(a, b) for a, b in itertools.permutations(names, 2) if templates[a] == templates[b]]


def _label(asked: Asked) -> str:
    return f"{asked.source[1]} -> {asked.target[1]}, {asked.kind}"


@cache
def _shape(root: str, key: str, name: str) -> Shape:
    shape = find_set(root, f"{key}_5k_remeshed").load(name)
    return Shape(shape.mesh, shape.truth.as_template_to_shape(), shape.mirror)


def _look(root: str, store: str, study: ConfidenceStudy, asked: Asked) -> list[Seen]:
    """Match one pair in every way, and compare with the truth."""
    source, target = (_shape(root, *which) for which in (asked.source, asked.target))
    first = cut_extremity(source.mesh, asked.cut) if asked.kind == "source cut" else _undamaged(source)
    second = cut_extremity(target.mesh, asked.cut) if asked.kind == "target cut" else _undamaged(target)
    method, kept = as_method(study.descriptor), Store(store)
    here, there = (method.describe(damaged.mesh, kept) for damaged in (first, second))
    at, truth = _known(asked, source, target, first, study.points)
    found = []
    for name in study.refine:
        sides, start = _both(here, there, name)
        signals = map_signals(sides)
        if start is not None:
            signals = np.hstack([signals, spectral_signals(sides, start)])
        matched = second.kept[sides.forward.indices[at]]
        away = geodesics(target.mesh, "heat").pairs(np.maximum(truth, 0), matched) / np.sqrt(target.mesh.area)
        there_too = (truth >= 0) & np.isin(truth, second.kept)
        found.append(Seen(asked.kind, name, signals[at], there_too & (away < RIGHT)))
    return found


def _undamaged(shape: Shape) -> Damaged:
    return Damaged(shape.mesh, np.arange(shape.mesh.n_vertices))


def _known(asked: Asked, source: Shape, target: Shape, first: Damaged, points: int) -> tuple[IntArray, IntArray]:
    """Return points of the (cut) source and the vertices of the whole target that they truly are, -1 for none."""
    rng = np.random.default_rng(0)
    if asked.kind == "other kinds":
        at = rng.permutation(first.mesh.n_vertices)[:points]
        return at, np.full(len(at), -1)
    new = np.full(source.mesh.n_vertices, -1)
    new[first.kept] = np.arange(len(first.kept))
    s, t = source.truth.indices, target.truth.indices
    both = np.flatnonzero((s >= 0) & (t >= 0))
    both = both[new[s[both]] >= 0]
    chosen = rng.permutation(both)[:points]
    return new[s[chosen]], t[chosen]


def _both(here: Described, there: Described, refine: str) -> tuple[Sides, VertexMap | None]:
    rule, improver = matcher("nearest"), refiner("none" if refine == NEAREST else refine)
    start = rule(here, there)
    if improver is None:
        return Sides(here, there, start, rule(there, here)), None
    done = improver(start, here, there)
    if done.backward is None:
        raise ConfigError(f"confidence: {refine} makes no map backwards; take one that does, such as joint")
    return Sides(here, there, done.forward.vertex_map, done.backward.vertex_map), start


def fitted(seen: Sequence[Seen]) -> dict[str, Calibration]:
    """Fit the calibrations "map", of nearest neighbours, and "refined"."""
    found = {}
    for kind, names in (("map", OF_MAPS), ("refined", (*OF_MAPS, *OF_REFINED))):
        some = [s for s in seen if (s.refine == NEAREST) == (kind == "map")]
        if not some:
            raise ConfigError(f"confidence: fit=true needs {NEAREST} and a refinement among refine")
        signals, right = np.concatenate([s.signals for s in some]), np.concatenate([s.right for s in some])
        found[kind] = fit_calibration(signals, right, names)
    return found


def _record(known: dict[str, Calibration], study: ConfidenceStudy, count: int) -> dict[str, Any]:
    how = (
        f"logistic regressions on {count} pairs of FAUST 0 to 79 and of TOSCA's cats, dogs and wolves, by "
        f"{study.descriptor}; csm reproduce confidence confidence.fit=true"
    )
    return {"fitted": how, **{kind: asdict(found) for kind, found in known.items()}}


def _probability(known: dict[str, Calibration], seen: Seen) -> FloatArray:
    if seen.refine == NEAREST:
        return known["map"].probability(seen.signals)
    return refined_probability(known["refined"], seen.signals)


def _groups(seen: Sequence[Seen]) -> dict[tuple[str, str], list[Seen]]:
    groups: dict[tuple[str, str], list[Seen]] = {}
    for one in seen:
        groups.setdefault((one.refine, "all"), []).append(one)
        groups.setdefault((one.refine, one.kind), []).append(one)
    return dict(sorted(groups.items()))


def _row(name: str, kind: str, seen: Sequence[Seen], known: dict[str, Calibration]) -> dict[str, Any]:
    confidence = np.concatenate([_probability(known, s) for s in seen])
    right = np.concatenate([s.right for s in seen])
    wrong, fifth = ~right, len(right) // 5
    least = np.argsort(confidence, kind="stable")[:fifth]
    total = int(wrong.sum())
    return {
        "map": name,
        "pairs": kind,
        "count": len(seen),
        "wrong %": 100 * float(wrong.mean()),
        "caught %": 100 * float(wrong[least].sum()) / total if total else None,
        "at most %": 100 * min(1.0, fifth / total) if total else None,
        "mean confidence %": 100 * float(confidence.mean()),
        "Brier": float(((confidence - right) ** 2).mean()),
        "reliability": [list(step) for step in _steps(confidence, right)],
    }


def _curve(known: dict[str, Calibration], seen: Sequence[Seen]) -> list[tuple[float, float, int]]:
    confidence = np.concatenate([_probability(known, s) for s in seen])
    return list(_steps(confidence, np.concatenate([s.right for s in seen])))


def _steps(confidence: FloatArray, right: BoolArray) -> Iterator[tuple[float, float, int]]:
    """Yield mean confidence, share of right matches and count for each tenth of the range of confidence."""
    step = np.minimum((10 * confidence).astype(int), 9)
    for i in range(10):
        if (inside := step == i).any():
            yield float(confidence[inside].mean()), float(right[inside].mean()), int(inside.sum())
