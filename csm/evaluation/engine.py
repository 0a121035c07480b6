"""The engine that measures: shapes x pairs x methods x matchers x perturbations, target by target.

All matches on one target are measured together, because they ask for distances from the same vertices.  What is
finished of a target is kept where the caller says, so that a killed evaluation goes on where it was, and further
methods cost only themselves.

A perturbation changes the targets before they are matched, such as `csm.mesh.perturb.with_noise`.  Errors are measured
on the target as it was, at the points that are left of it.  What cannot be done with a changed target, by one method
for example, is no error of the evaluation but a reason in `Evaluation.failures`.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Protocol, TypeVar

from csm._counts import counted
from csm._parallel import n_processes, parallel_map
from csm.data.prepare import Job, prepare
from csm.data.shapes import InMemory, Shape, ShapeSet, templates_of
from csm.data.store import Store
from csm.descriptors.base import Descriptor
from csm.errors import ConfigError, DataError
from csm.evaluation.protocol import EvaluationProtocol, Pair
from csm.evaluation.results import Cell, Evaluation, PairErrors, summarise
from csm.evaluation.targets import Perturbation, Plan, TargetTask, matched_tasks, measure_target
from csm.matching.base import Matcher, require_device
from csm.matching.methods import Method, as_method, require_classifier
from csm.matching.refinement.base import Refiner
from csm.matching.registry import matchers as as_matchers

_log = logging.getLogger(__name__)


def evaluate(
    method: Method | Descriptor | str | Sequence[Method | Descriptor | str],
    shapes: ShapeSet | Sequence[Shape],
    protocol: EvaluationProtocol | None = None,
    *,
    matching: str | Matcher | Sequence[str | Matcher] = "nearest",
    refine: str | Refiner | Sequence[str | Refiner] = "none",
    names: Sequence[str] | None = None,
    perturbations: Mapping[str, Perturbation | None] | None = None,
    store: Store | None = None,
    results: Store | None = None,
    workers: int | None = None,
    device: str = "cpu",
    skip_failures: bool = False,
    keep_pairs: bool = False,
    progress: bool = True,
) -> list[Evaluation]:
    """Match pairs of shapes with known correspondence by each method and matcher, and measure the errors.

    Parameters
    ----------
    method
        One or several: descriptors, names of presets, trained networks (`csm.load_model`).
    shapes
        A set over one template, such as those of `csm.find_set`, or shapes in memory.
    protocol
        Pairs, points, distance and normaliser; by default all, exact, as fractions of the diameter.
    matching, refine
        One or several matchers, and refiners (`csm.matching.refinement`) that each is followed by; "none" for it alone.
    names
        Of the shapes to evaluate; by default all of the set whose correspondence is known.  Of a set with several
        templates, such as TOSCA with its classes, only shapes of one template make a pair.
    perturbations
        Title -> how targets are changed before they are matched, None for not at all; see the module.
    store, results
        Of what is prepared and of distances (by default csm's in the user's cache folder); of finished targets.
    workers, device
        Processes of one thread, see `csm._parallel.n_processes`; where networks run and features are compared.
    skip_failures, keep_pairs, progress
        Leave out what cannot be used, with the reason in `Evaluation.failures`, instead of raising; return the errors
        point by point in `Evaluation.pairs`; show progress bars.

    Returns
    -------
    list of Evaluation
        One per perturbation, method and matcher, in this order; without numbers where nothing could be measured.

    Raises
    ------
    DataError
        If there is no pair, no common template point, or nothing could be measured.
    ConfigError
        If a method, matcher, refiner or device is unknown, or two have one name.
    """
    rules = as_matchers(_listed(matching), _listed(refine))
    plan = _plan(method, shapes, protocol, rules, perturbations, store, results, device, skip_failures)
    templates = templates_of(plan.shapes)
    pairs = plan.protocol.choose(list(templates if names is None else names), templates)
    return _run(plan, pairs, workers, keep_pairs, progress)


def _plan(
    method: Method | Descriptor | str | Sequence[Method | Descriptor | str],
    shapes: ShapeSet | Sequence[Shape],
    protocol: EvaluationProtocol | None,
    rules: Sequence[Matcher],
    perturbations: Mapping[str, Perturbation | None] | None,
    store: Store | None,
    results: Store | None,
    device: str,
    skip_failures: bool,
) -> Plan:
    methods = _by_name([as_method(m) for m in _listed(method)], "methods")
    if not skip_failures:
        require_classifier(methods.values(), rules)
    return Plan(
        InMemory(shapes) if isinstance(shapes, Sequence) else shapes,
        protocol or EvaluationProtocol(),
        methods,
        _by_name(rules, "matchers"),
        perturbations or {"": None},
        store or Store(),
        results,
        require_device(device),
        skip_failures,
    )


def _listed(one_or_more: Any) -> Sequence[Any]:
    several = isinstance(one_or_more, Sequence) and not isinstance(one_or_more, str)
    return one_or_more if several else [one_or_more]


def _run(plan: Plan, pairs: Sequence[Pair], workers: int | None, keep_pairs: bool, progress: bool) -> list[Evaluation]:
    begun = time.perf_counter()
    unusable = _prepare(plan, pairs, workers, progress)
    left = [pair for pair in pairs if not set(pair) & set(unusable)]
    found = _measure_targets(plan, left, workers, progress)
    reasons = unusable | {name: why for _, failed in found.values() for name, why in failed.items()}
    for what, why in reasons.items():
        _log.warning("%s is left out: %s", what, why)
    if not any(measured for measured, _ in found.values()):
        raise DataError(
            f"{plan.shapes.name}: none of the {counted(len(pairs), 'pair')} could be measured:\n"
            + "\n".join(f"{what}: {why}" for what, why in reasons.items())
        )
    seconds = time.perf_counter() - begun
    return [
        summarise(
            [measured[pair] for pair in left if pair in measured],
            plan.protocol,
            seconds,
            method=cell.method,
            matcher=cell.matcher,
            perturbation=cell.perturbation,
            failures=unusable | failed,
            keep_pairs=keep_pairs,
        )
        for cell, (measured, failed) in found.items()
    ]


class _Named(Protocol):
    @property
    def name(self) -> str: ...


N = TypeVar("N", bound=_Named)


def _by_name(things: Sequence[N], what: str) -> dict[str, N]:
    named = {thing.name: thing for thing in things}
    if len(named) != len(things) or not named:
        raise ConfigError(
            f"evaluate: {len(things)} {what} have the names {', '.join(t.name for t in things) or 'of none'}; "
            "wanted one or more with different names, such as csm.matching.DescriptorMethod(csm.ACD(alpha=5.0), 'mild')"
        )
    return named


def _prepare(plan: Plan, pairs: Sequence[Pair], workers: int | None, progress: bool) -> dict[str, str]:
    """Fill the store for all shapes and methods; return which shapes cannot be read or prepared, and why."""
    recipes = [method.recipe for method in plan.methods.values()]
    wanted = [recipe for i, recipe in enumerate(recipes) if recipe is not None and recipe not in recipes[:i]]
    names = list(dict.fromkeys(name for pair in pairs for name in pair))
    if not wanted and not plan.skip_failures:
        return {}
    jobs = [Job(plan.shapes, name) for name in names]
    summary = prepare(jobs, wanted, plan.store, workers=workers, progress=progress)
    if summary.failures and not plan.skip_failures:
        raise DataError(f"{len(summary.failures)} of {counted(len(jobs), 'shape')} cannot be used:\n{summary.table()}")
    labels = {job.label: job.name for job in jobs}
    return {labels[label]: why for label, why in summary.failures}


def _measure_targets(
    plan: Plan, pairs: Sequence[Pair], workers: int | None, progress: bool
) -> dict[Cell, tuple[dict[Pair, PairErrors], dict[str, str]]]:
    """Return for every cell its measured pairs, and which targets or pairs failed and why."""
    sources: dict[str, list[str]] = {}
    for source, target in pairs:
        sources.setdefault(target, []).append(source)
    tasks: Iterator[TargetTask] = (TargetTask(plan, target, tuple(names)) for target, names in sources.items())
    processes = n_processes(workers, len(sources))
    done = parallel_map(
        measure_target,
        tasks if plan.matched_in_workers and processes > 1 else matched_tasks(tasks, plan.memory()),
        lambda task: task.target,
        processes,
        what=f"match {plan.shapes.name}",
        unit="target",
        total=len(sources),
        progress=progress,
    )
    return {
        cell: (
            {one.pair: one for found in done for one in found.pairs.get(cell, ())},
            {what: why for found in done for what, why in found.failed.get(cell, {}).items()},
        )
        for cell in plan.cells
    }
