"""How matching suffers when the target is damaged: shared by the figures of noise and of missing and grown parts.

Errors are measured on the target as it was, at the points that are left of it, so that they compare between damages.
"""

from __future__ import annotations

import functools
import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch

from csm._progress import progress_bar
from csm._types import IntArray
from csm.data.shapeset import Shape
from csm.errors import ConfigError, MeshError
from csm.evaluation.distances import MatchedPoints, target_errors
from csm.evaluation.matching import nearest
from csm.mesh.correspondence import ground_truth
from csm.mesh.perturb import Damaged
from csm.mesh.shape import Mesh
from csm.operators.geodesic import Method as Distance
from csm.studies.bodies import Bodies
from csm.studies.contestants import Contestant
from csm.studies.kept import keep, recall
from csm.studies.study import Context

Damage = Callable[[Mesh], Damaged]
Describe = Callable[[Mesh], torch.Tensor]
Key = tuple[str, str]
TESTED = 20
"""The last so many bodies, which no network was trained on."""


@dataclass(frozen=True)
class Plan:
    """What is measured.

    Parameters
    ----------
    n_pairs
        Ordered pairs of test bodies, drawn without replacement.
    points
        Template points per pair, drawn without replacement.
    distance
        Kind of geodesic distance.
    """

    n_pairs: int = 20
    points: int = 300
    distance: Distance = "exact"

    def __post_init__(self) -> None:
        if min(self.n_pairs, self.points) < 1:
            raise ConfigError(f"pairs and points are from 1, got {self.n_pairs} and {self.points}")


def damage_rows(
    context: Context, bodies: Bodies, damages: Mapping[str, Damage], methods: Mapping[str, Contestant], plan: Plan
) -> list[dict[str, Any]]:
    """Match whole bodies onto damaged ones by every method; one row per damage and method, in this order.

    What was measured for a target is kept in ``damage/`` of the folder of artefacts.  A method that cannot describe a
    damaged mesh is given the reason in its row instead of numbers.
    """
    pairs = _draw_pairs(bodies.original.names[-TESTED:], plan.n_pairs, context.seed)
    targets = list(dict.fromkeys(target for _, target in pairs))
    found: dict[Key, list[dict[str, Any]]] = {(d, m): [] for d in damages for m in methods}
    for name in progress_bar(targets, desc="match", unit="target"):
        sources = [bodies.original.load(source) for source, other in pairs if other == name]
        cells = _cells(context, bodies.original.load(name), sources, damages, methods, plan)
        for key, cell in cells.items():
            found[key].append(cell)
    return [{"damage": title, "method": method, **_summary(cells)} for (title, method), cells in found.items()]


def by_method(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return a line per method with its error by every damage, such as "5.2 ± 0.3", and the rows as its `cells`."""
    lines: dict[str, dict[str, Any]] = {}
    for row in rows:
        line = lines.setdefault(row["method"], {"method": row["method"], "cells": []})
        line["cells"].append(dict(row))
        if row["error"] is not None:
            spread = "" if row["standard error"] is None else f" ± {row['standard error']:.1f}"
            line[row["damage"]] = f"{row['error']:.1f}{spread}"
    return list(lines.values())


def _cells(
    context: Context,
    target: Shape,
    sources: Sequence[Shape],
    damages: Mapping[str, Damage],
    methods: Mapping[str, Contestant],
    plan: Plan,
) -> dict[Key, dict[str, Any]]:
    """Return what was measured on one target, from files where it is there; what is not is measured together."""
    meshes = [shape.mesh.digest for shape in (target, *sources)]
    settings = [plan.points, plan.distance, context.seed]
    questions: dict[Key, dict[str, Any]] = {
        (title, method): {"damage": title, "method": contestant.key, "meshes": meshes, "plan": settings}
        for title in damages
        for method, contestant in methods.items()
    }
    files = {key: context.out / "damage" / _file(question) for key, question in questions.items()}
    cells = {key: recall(files[key], question) for key, question in questions.items()}
    missing = [key for key, cell in cells.items() if cell is None]
    made = _measure(target, sources, missing, damages, methods, plan, context.seed) if missing else {}
    return {key: keep(files[key], questions[key], made[key]) if cell is None else cell for key, cell in cells.items()}


def _draw_pairs(names: Sequence[str], n: int, seed: int) -> list[tuple[str, str]]:
    pairs = [(a, b) for a in names for b in names if a != b]
    chosen = np.random.default_rng(seed).permutation(len(pairs))[:n]
    return [pairs[i] for i in sorted(chosen)]


def _file(question: Mapping[str, Any]) -> str:
    return f"{hashlib.sha256(json.dumps(dict(question), sort_keys=True).encode()).hexdigest()[:24]}.json"


def _measure(
    target: Shape,
    sources: Sequence[Shape],
    keys: Sequence[Key],
    damages: Mapping[str, Damage],
    methods: Mapping[str, Contestant],
    plan: Plan,
    seed: int,
) -> dict[Key, dict[str, Any]]:
    """Match by these damages and methods, then measure all together: most points are the same, and their distances."""
    made: dict[Key, dict[str, Any]] = {}
    matched: dict[Key, list[MatchedPoints]] = {}
    whole = {method: functools.cache(contestant.describe) for method, contestant in methods.items()}
    once = {title: functools.cache(damage) for title, damage in damages.items()}
    for title, method in keys:
        try:
            damaged = once[title](target.mesh)
            there = methods[method].describe(damaged.mesh)
        except MeshError as error:
            made[title, method] = {"failed": str(error)}
            continue
        matched[title, method] = [
            _matched(source, target, damaged, there, whole[method], plan.points, seed) for source in sources
        ]
        made[title, method] = {"left": len(damaged.kept) / target.mesh.n_vertices}
    if not matched:
        return made
    measured = target_errors(target.mesh, plan.distance, "diameter", [p for points in matched.values() for p in points])
    errors = iter(measured.errors)
    for key in matched:
        distances = np.concatenate([next(errors).distance for _ in sources]) / measured.lengths.diameter
        made[key]["errors"] = distances.round(6).tolist()
    return made


def _matched(
    source: Shape, target: Shape, damaged: Damaged, there: torch.Tensor, whole: Describe, points: int, seed: int
) -> MatchedPoints:
    truth = ground_truth(source.truth, target.truth)
    left: IntArray = np.flatnonzero(np.isin(truth.target, damaged.kept))
    chosen = left[np.random.default_rng(seed).permutation(len(left))[:points]]
    here = whole(source.mesh)
    found = damaged.kept[nearest(here[torch.as_tensor(truth.source[chosen])], there)]
    return MatchedPoints(truth.target[chosen], found)


def _summary(cells: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    failures = [str(cell["failed"]) for cell in cells if "failed" in cell]
    if failures:
        return {"error": None, "exact %": None, "within 5 % of the diameter, %": None, "failed": failures[0]}
    errors = np.concatenate([cell["errors"] for cell in cells])
    means = [float(np.mean(cell["errors"])) for cell in cells]
    return {
        "error": 1000 * float(errors.mean()),
        "standard error": 1000 * float(np.std(means, ddof=1) / len(means) ** 0.5) if len(means) > 1 else None,
        "exact %": 100 * float((errors == 0).mean()),
        "within 5 % of the diameter, %": 100 * float((errors <= 0.05).mean()),
        "vertices left": float(np.mean([cell["left"] for cell in cells])),
    }
