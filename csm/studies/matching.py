"""Nearest-neighbour matching by many descriptors on the pairs of a set, measured target by target and kept."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from csm._processes import run_all
from csm._types import Arrays
from csm.data.prepare import compute_features
from csm.data.shapeset import Shape, ShapeSet
from csm.data.store import Store, read_entry
from csm.descriptors.base import Descriptor, record
from csm.errors import CsmError
from csm.evaluation.distances import Lengths, MatchedPoints, PointErrors
from csm.evaluation.matching import nearest
from csm.evaluation.protocol import Pair, Protocol, matched_points, thinned
from csm.evaluation.results import PairErrors
from csm.studies.measure import Measured, Question, chosen_points, errors_on_target


@dataclass(frozen=True, eq=False)
class Rules:
    """How matches are measured.

    Parameters
    ----------
    protocol
        Points, seed and normaliser; its distance is exact.
    exact_points
        How many template points are measured exactly, the others along edges and scaled (see
        `csm.studies.measure`); None for all.
    """

    protocol: Protocol
    exact_points: int | None


@dataclass(frozen=True, eq=False)
class Matched:
    """The errors of one descriptor on one target, with what the exactly measured points leave uncertain.

    Parameters
    ----------
    pairs
        One per source.
    variances
        Of the mean distance of each pair, as `csm.studies.measure.Errors.variance`.
    """

    pairs: tuple[PairErrors, ...]
    variances: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class _Task:
    shapes: ShapeSet
    target: str
    sources: tuple[str, ...]
    descriptors: Mapping[str, Descriptor]
    rules: Rules
    store: Store
    parts: Store


@dataclass(frozen=True, eq=False)
class _Done:
    files: Mapping[str, Path]
    failure: str = ""


def match_pairs(
    shapes: ShapeSet,
    pairs: Sequence[Pair],
    descriptors: Mapping[str, Descriptor],
    rules: Rules,
    stores: tuple[Store, Store],
    workers: int,
) -> tuple[dict[str, list[Matched]], dict[str, str]]:
    """Match and measure; return for each descriptor what came out target by target, and which targets failed and why.

    All descriptors on a target are measured together, because they ask for distances from the same vertices.

    Parameters
    ----------
    shapes, pairs
        The (source, target) names in the set.
    descriptors
        By name.
    rules
        How to measure.
    stores
        Of the descriptors, and of the results of each target, where those that are there are not made again.
    workers
        Processes of one thread.
    """
    sources: dict[str, list[str]] = {}
    for source, target in pairs:
        sources.setdefault(target, []).append(source)
    tasks = [_Task(shapes, target, tuple(names), descriptors, rules, *stores) for target, names in sources.items()]
    done = run_all(_match, tasks, lambda task: task.target, workers, what=f"match {shapes.name}", unit="target")
    failures = {task.target: answer.failure for task, answer in zip(tasks, done, strict=True) if answer.failure}
    found = {
        name: [_read(t, answer.files[name]) for t, answer in zip(tasks, done, strict=True) if answer.files]
        for name in descriptors
    }
    return found, failures


def _match(task: _Task) -> _Done:
    try:
        target = thinned(task.shapes.load(task.target), task.rules.protocol)
        sources = [thinned(task.shapes.load(name), task.rules.protocol) for name in task.sources]
        keys = {name: _key(task, target, sources, d) for name, d in task.descriptors.items()}
        missing = [name for name, key in keys.items() if not task.parts.has("matched", target.mesh, key)]
        made = _measure(task, target, sources, missing) if missing else {}
        for name, arrays in made.items():
            task.parts.fetch("matched", target.mesh, keys[name], lambda arrays=arrays: arrays)  # type: ignore[misc]
        return _Done({name: task.parts.path("matched", target.mesh, key) for name, key in keys.items()})
    except CsmError as error:
        return _Done({}, str(error))


def _key(task: _Task, target: Shape, sources: Sequence[Shape], descriptor: Descriptor) -> dict[str, object]:
    maps = hashlib.sha256()
    for shape in (target, *sources):
        maps.update(shape.mesh.digest.encode())
        maps.update(np.ascontiguousarray(shape.truth.as_template_to_shape().indices, dtype="<i8").tobytes())
    return {
        "descriptor": record(descriptor),
        "shapes and maps": maps.hexdigest(),
        "exact_points": task.rules.exact_points,
        "seed": task.rules.protocol.seed,
        "normaliser": task.rules.protocol.normaliser,
    }


def _measure(task: _Task, target: Shape, sources: Sequence[Shape], names: Sequence[str]) -> dict[str, Arrays]:
    questions = []
    for name in names:
        descriptor = task.descriptors[name]
        there = compute_features(target.mesh, descriptor, task.store)
        for source in sources:
            here = compute_features(source.mesh, descriptor, task.store)
            indices = nearest(here, there, at=np.unique(source.truth.as_template_to_shape().known))
            points = matched_points(source, target, lambda _s, _t, indices=indices: indices)  # type: ignore[misc]
            exact = chosen_points(source.truth, target.truth, task.rules.exact_points, task.rules.protocol.seed)
            questions.append(Question(name, points, exact))
    measured = errors_on_target(target, questions, task.rules.protocol.normaliser)
    return {name: _arrays(questions, measured, name) for name in names}


def _arrays(questions: Sequence[Question], measured: Measured, name: str) -> Arrays:
    mine = [(q, e) for q, e in zip(questions, measured.errors, strict=True) if q.descriptor == name]
    flips = [e.points.flip for _, e in mine]
    return {
        "truth": np.concatenate([q.points.truth for q, _ in mine]).astype(np.int32),
        "matched": np.concatenate([q.points.matched for q, _ in mine]).astype(np.int32),
        "distance": np.concatenate([e.points.distance for _, e in mine]).astype(np.float32),
        "points": np.array([len(q.points.truth) for q, _ in mine]),
        "flip": np.concatenate([np.empty(0, dtype=bool) if f is None else f for f in flips]),
        "flips": np.array([-1 if f is None else len(f) for f in flips]),
        "unreachable": np.array([e.points.unreachable for _, e in mine]),
        "variance": np.array([e.variance() for _, e in mine]),
        "lengths": np.array([measured.lengths.diameter, measured.lengths.sqrt_area]),
    }


def _read(task: _Task, path: Path) -> Matched:
    a = read_entry(path)[1]
    lengths = Lengths(*(float(x) for x in a["lengths"]))
    cuts = np.cumsum(a["points"])[:-1]
    truth, matched, distance = (np.split(a[key], cuts) for key in ("truth", "matched", "distance"))
    flips = np.split(a["flip"], np.cumsum(np.maximum(a["flips"], 0))[:-1])
    pairs = tuple(
        PairErrors(
            (source, task.target),
            MatchedPoints(truth[i].astype(np.int64), matched[i].astype(np.int64)),
            PointErrors(
                distance[i].astype(np.float64), None if a["flips"][i] < 0 else flips[i], int(a["unreachable"][i])
            ),
            lengths,
        )
        for i, source in enumerate(task.sources)
    )
    return Matched(pairs, tuple(float(v) for v in a["variance"]))
