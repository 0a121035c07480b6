"""Matching and measuring everything that is asked about one target shape."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache, partial
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from csm.data.shapes import InMemory, Shape, ShapeSet
from csm.data.store import Store
from csm.errors import CsmError, DataError
from csm.evaluation.distances import MatchedPoints, target_errors
from csm.evaluation.memory import Memory
from csm.evaluation.protocol import EvaluationProtocol, Pair
from csm.evaluation.results import Cell, PairErrors, from_arrays, to_arrays
from csm.matching.base import Described, Matcher
from csm.matching.methods import DescriptorMethod, Method
from csm.matching.refinement import Refined
from csm.mesh.correspondence import ground_truth
from csm.mesh.perturb import Damaged
from csm.mesh.shape import Mesh
from csm.operators.geodesic import EXACT_VERSION

Perturbation: TypeAlias = Callable[[Mesh], Damaged]
"""A change of a mesh; of a module, not a lambda, where there are workers."""


@dataclass(frozen=True, eq=False)
class Plan:
    """What one evaluation asks.

    Parameters
    ----------
    shapes
        The set.
    protocol
        Points, distance and normaliser.
    methods, matchers, perturbations
        By their names.
    store
        Of descriptors, bases and distances.
    results
        Where finished targets are kept; None for nowhere.
    device
        Where features are computed and compared.
    skip_failures
        Whether what cannot be used is left out.
    """

    shapes: ShapeSet
    protocol: EvaluationProtocol
    methods: Mapping[str, Method]
    matchers: Mapping[str, Matcher]
    perturbations: Mapping[str, Perturbation | None]
    store: Store
    results: Store | None
    device: str
    skip_failures: bool

    @property
    def cells(self) -> list[Cell]:
        """All combinations."""
        return [Cell(p, m, rule) for p in self.perturbations for m in self.methods for rule in self.matchers]

    @property
    def matched_in_workers(self) -> bool:
        """Whether any process can match: descriptors are found in the store; networks and devices stay in this one."""
        return self.device == "cpu" and all(isinstance(m, DescriptorMethod) for m in self.methods.values())

    def memory(self) -> Memory:
        """Return an empty memory of the shapes and methods."""
        refined = any(isinstance(rule, Refined) for rule in self.matchers.values())
        return Memory(self.shapes, self.methods, self.store, self.device, refined)


class Matches(NamedTuple):
    """The matched points of one target, which are to be measured.

    `points` has an entry per source for every cell; `left` has for every perturbation the fraction of vertices that it
    leaves; `keys` are the cache keys of the cells; `kept` are the stored results of earlier runs; `failed` says for a
    cell what cannot be measured, the target or a pair, and why.
    """

    mesh: Mesh
    points: dict[Cell, dict[str, MatchedPoints]]
    left: dict[str, float]
    keys: dict[Cell, dict[str, Any]]
    kept: dict[Cell, list[PairErrors]]
    failed: dict[Cell, dict[str, str]]


@dataclass(frozen=True, eq=False)
class TargetTask:
    """One target with its sources; `matches` where they are made before the task reaches a process."""

    plan: Plan
    target: str
    sources: tuple[str, ...]
    matches: Matches | None = None

    @property
    def pairs(self) -> list[Pair]:
        """All pairs with this target."""
        return [(source, self.target) for source in self.sources]


class Found(NamedTuple):
    """What came out of one target: for every cell its pairs, and what is not there, the target or a pair, and why."""

    pairs: dict[Cell, list[PairErrors]]
    failed: dict[Cell, dict[str, str]]


def matched_tasks(tasks: Iterator[TargetTask], memory: Memory) -> Iterator[TargetTask]:
    """Match in this process, target by target; what comes out can be measured in any other."""
    for task in tasks:
        matches = match_target(task, memory)
        plan = replace(task.plan, shapes=InMemory([]), methods={}, matchers={}, perturbations={})
        yield TargetTask(plan, task.target, task.sources, matches)


def match_target(task: TargetTask, memory: Memory) -> Matches:
    """Match every source onto the target, in every cell that has no stored result."""
    plan, target = task.plan, memory.shape(task.target)
    maps = "" if plan.results is None else _digest([target, *map(memory.shape, task.sources)])
    matches = Matches(target.mesh, {}, {}, {}, {}, {})
    for title, change in plan.perturbations.items():
        cells = [cell for cell in plan.cells if cell.perturbation == title]
        try:
            changed = None if change is None else change(target.mesh)
        except CsmError as error:
            matches.failed.update({cell: {task.target: str(error)} for cell in cells})
            continue
        matches.left[title] = 1.0 if changed is None else len(changed.kept) / target.mesh.n_vertices
        there = cache(partial(_target, task, changed, memory))
        for cell in cells:
            if not _is_kept(task, cell, maps, changed, matches):
                _match_cell(task, cell, there, changed, memory, matches)
    return matches


def _match_cell(
    task: TargetTask,
    cell: Cell,
    there: Callable[[str], Described],
    changed: Damaged | None,
    memory: Memory,
    matches: Matches,
) -> None:
    """Match every source in one cell; note what fails, unless that is an error of the evaluation."""
    try:
        target = there(cell.method)
    except CsmError as error:
        if changed is None and not task.plan.skip_failures:
            raise
        matches.failed[cell] = {task.target: str(error)}
        return
    found, failed = {}, {}
    for source in task.sources:
        try:
            found[source] = _points(task, cell, source, target, changed, memory)
        except CsmError as error:
            if changed is None and not task.plan.skip_failures:
                raise
            failed[f"{source} -> {task.target}"] = str(error)
    if found:
        matches.points[cell] = found
    if failed:
        alike = not found and len(set(failed.values())) == 1
        matches.failed[cell] = {task.target: next(iter(failed.values()))} if alike else failed


def _target(task: TargetTask, changed: Damaged | None, memory: Memory, method: str) -> Described:
    if changed is None:
        return memory.described(method, task.target)
    return task.plan.methods[method].describe(changed.mesh, task.plan.store, task.plan.device)


def _points(
    task: TargetTask, cell: Cell, source_name: str, there: Described, changed: Damaged | None, memory: Memory
) -> MatchedPoints:
    """Match one source onto the (changed) target and return the points of the protocol, as vertices of the whole one.

    Raises
    ------
    DataError
        If the shapes have no template point in common, or the matcher leaves a point without a match.
    """
    source, target = memory.shape(source_name), memory.shape(task.target)
    ground_truth(source.truth, target.truth)  # it says what is wrong if there is none
    s, t, n = source.truth, target.truth, target.mesh.n_vertices
    kept = np.arange(n) if changed is None else changed.kept
    left = np.zeros(n, dtype=bool)
    left[kept] = True
    chosen = task.plan.protocol.points_of(s, t, left)
    if not len(chosen.template):
        raise DataError(f"{source.name} -> {target.name}: none of the points that are measured is left on the target")
    begin = s.indices[chosen.template]
    here = memory.described(cell.method, source_name)
    found = task.plan.matchers[cell.matcher](here, there, at=np.unique(begin)).indices
    if len(found) != source.mesh.n_vertices or found[begin].min() < 0 or found.max() >= len(kept):
        raise DataError(
            f"{source.name} -> {target.name}: {cell.matcher} gave {len(found)} numbers in "
            f"{found.min(initial=len(kept))}..{found.max(initial=-1)}; wanted {source.mesh.n_vertices}, one per vertex "
            f"of the source, and where points are measured in 0..{len(kept) - 1}"
        )
    mirror = target.mirror
    return MatchedPoints(
        begin,
        t.indices[chosen.template],
        kept[found[begin]],
        chosen.exact,
        None if mirror is None else mirror.as_template_to_shape(t.n_from).indices[chosen.template],
        cell,
    )


def measure_target(task: TargetTask) -> Found:
    """Measure everything on one target; match first where that is not done yet."""
    plan = task.plan
    matches = task.matches or match_target(task, plan.memory())
    measured: dict[Cell, list[PairErrors]] = {}
    failed = dict(matches.failed)
    if matches.points:
        try:
            measured = _errors(task, matches)
        except CsmError as error:
            if not plan.skip_failures:
                raise
            failed |= {cell: {task.target: str(error)} for cell in matches.points}
    return Found(matches.kept | measured, failed)


def _errors(task: TargetTask, matches: Matches) -> dict[Cell, list[PairErrors]]:
    """Measure the points of all cells together, because most are the same, and store the results."""
    plan, together = task.plan, [points for of_cell in matches.points.values() for points in of_cell.values()]
    distance = plan.protocol.distance_on(matches.mesh)
    memo = plan.store if distance == "exact" else None
    measured = target_errors(matches.mesh, together, distance, plan.protocol.normaliser, memo)
    errors = iter(measured.errors)
    found = {}
    for cell, of_cell in matches.points.items():
        pairs = [
            PairErrors((source, task.target), points, next(errors), measured.lengths, matches.left[cell.perturbation])
            for source, points in of_cell.items()
        ]
        if plan.results is not None and len(pairs) == len(task.sources):
            kept = plan.results.fetch("matched", matches.mesh, matches.keys[cell], partial(to_arrays, pairs))
            pairs = from_arrays(kept, task.pairs)
        found[cell] = pairs
    return found


def _is_kept(task: TargetTask, cell: Cell, maps: str, changed: Damaged | None, matches: Matches) -> bool:
    """Tell whether the result of a cell is stored; note its cache key, and the result if it is there."""
    if task.plan.results is None:
        return False
    matches.keys[cell] = _key(task.plan, cell, maps, changed)
    arrays = task.plan.results.read("matched", matches.mesh, matches.keys[cell])
    if arrays is not None:
        matches.kept[cell] = from_arrays(arrays, task.pairs)
    return arrays is not None


def _digest(shapes: Sequence[Shape]) -> str:
    """Return a hash of meshes and their maps from the template."""
    found = hashlib.sha256()
    for shape in shapes:
        found.update(shape.mesh.digest.encode())
        for points in (shape.truth, shape.mirror):
            found.update(b"" if points is None else np.ascontiguousarray(points.indices, dtype="<i8").tobytes())
    return found.hexdigest()


def _digest_of_change(changed: Damaged) -> str:
    kept = np.ascontiguousarray(changed.kept, dtype="<i8").tobytes()
    return hashlib.sha256(changed.mesh.digest.encode() + kept).hexdigest()


def _key(plan: Plan, cell: Cell, maps: str, changed: Damaged | None) -> dict[str, Any]:
    """Return the cache key of a cell on one target: everything that its result depends on."""
    asked = {name: value for name, value in asdict(plan.protocol).items() if name not in ("pairs", "sample")}
    if asked["fallback"] is None:
        del asked["fallback"]  # results from before there was one stay valid
    if asked["distance"] == "exact":
        asked["version"] = EXACT_VERSION
    return {
        "method": dict(plan.methods[cell.method].key),
        "matcher": {"name": cell.matcher, **plan.matchers[cell.matcher].parameters()},
        "changed": "" if changed is None else _digest_of_change(changed),
        "shapes and maps": maps,
        **asked,
    }
