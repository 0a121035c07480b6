"""Table 6: parameters, seconds and memory of every learned method, with ratios to CSMCNN."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from matplotlib.figure import Figure

from csm._progress import progress_bar
from csm.errors import ConfigError
from csm.mesh.shape import Mesh
from csm.studies.contenders import CONTENDERS
from csm.studies.kept import kept, this_machine
from csm.studies.steps import Cost, cost_of
from csm.studies.study import Context, Findings
from csm.studies.table2 import timed_mesh
from csm.viewer.comparisons import dots_figure
from csm.viewer.figures import save_figure

COLUMNS = (
    "method",
    "input",
    "parameters",
    "without classifier",
    "paper, million",
    "train epoch s",
    "test epoch s",
    "MB",
    "train to csmcnn",
    "test to csmcnn",
)
REFERENCE = "csmcnn"
"""The method that ratios are taken to."""


def run(
    context: Context,
    *,
    contenders: Sequence[str] = tuple(CONTENDERS),
    vertices: int = 6890,
    threads: int = 2,
    repeats: int = 5,
    train_shapes: int = 80,
    test_shapes: int = 20,
) -> Findings:
    """Measure every method on one body; an epoch is so many times one shape.

    Parameters
    ----------
    context
        Where data and artefacts are; what was measured is in its folder and not measured again.
    contenders
        Names of `csm.studies.contenders.CONTENDERS`.
    vertices
        Of the body, which are also the classes.
    threads
        Of PyTorch.
    repeats
        Measurements, of which the median counts.
    train_shapes, test_shapes
        Of an epoch.

    Raises
    ------
    ConfigError
        If a method is unknown or a number is below 1.
    """
    unknown = [name for name in contenders if name not in CONTENDERS]
    if unknown or not contenders:
        raise ConfigError(f"table6: {', '.join(unknown) or 'no method'}; choose out of {', '.join(CONTENDERS)}")
    if min(vertices, threads, repeats, train_shapes, test_shapes) < 1:
        raise ConfigError("table6: vertices, threads, repeats and numbers of shapes are from 1")
    mesh, whence = timed_mesh(context.root, context.store, vertices, context.seed)
    costs = {
        name: _cell(context, name, mesh, threads, repeats)
        for name in progress_bar(contenders, desc="measure", unit="method")
    }
    rows = [_row(name, costs, train_shapes, test_shapes) for name in contenders]
    notes = (
        f"Body: {whence}, {mesh.n_vertices} vertices, every one a class. {threads} threads; medians of {repeats} after "
        f"a step to warm up. Training epoch: {train_shapes} times forward, loss over all vertices, backward and Adam; "
        f"test epoch: {test_shapes} descriptors. Descriptors, bases and stencils are prepared before and not counted.",
        "MB: peak of the process's memory in training less what it held with the shape loaded.",
        "The classifier serves the training only. MGCN as released has 2.85 million parameters, the paper prints 3.03.",
    )
    title = "Parameters, seconds per epoch and memory of the learned methods."
    path = context.out / "table6.png"
    save_figure(path, _draw(rows))
    return Findings("table6", title, COLUMNS, rows, (*notes, *_busy(costs)), (path,))


def _cell(context: Context, name: str, mesh: Mesh, threads: int, repeats: int) -> Cost:
    question = {
        "contender": asdict(CONTENDERS[name]),
        "mesh": mesh.digest,
        "threads": threads,
        "repeats": repeats,
        "machine": this_machine(),
    }
    path = context.out / "costs" / f"{name}_{mesh.n_vertices}_{threads}.json"
    answer = kept(path, question, lambda: asdict(cost_of(CONTENDERS[name], mesh, context.store, threads, repeats)))
    return Cost.from_plain(answer)


def _row(name: str, costs: Mapping[str, Cost], train_shapes: int, test_shapes: int) -> dict[str, Any]:
    contender, cost, reference = CONTENDERS[name], costs[name], costs.get(REFERENCE)
    return {
        "name": name,
        "method": contender.title,
        "input": contender.descriptor,
        "parameters": cost.parameters,
        "without classifier": cost.parameters - cost.classifier,
        "paper, million": contender.paper_millions,
        "train epoch s": train_shapes * cost.seconds,
        "test epoch s": test_shapes * cost.test_seconds,
        "MB": None if cost.megabytes is None else round(cost.megabytes),
        "train to csmcnn": None if reference is None else cost.seconds / reference.seconds,
        "test to csmcnn": None if reference is None else cost.test_seconds / reference.test_seconds,
        "measurements": asdict(cost),
    }


def _draw(rows: Sequence[Mapping[str, Any]]) -> Figure:
    shown = {"parameters": ("parameters (million)", 1e-6), "train epoch s": ("training epoch (s)", 1.0)}
    shown |= {"test epoch s": ("test epoch (s)", 1.0), "MB": ("peak memory (MB)", 1.0)}
    panels = {
        title: {"": [float("nan") if row[key] is None else unit * row[key] for row in rows]}
        for key, (title, unit) in shown.items()
    }
    return dots_figure([row["method"] for row in rows], panels)


def _busy(costs: Mapping[str, Cost]) -> tuple[str, ...]:
    starved = [CONTENDERS[name].title for name, cost in costs.items() if cost.share < 0.8]
    return (f"Other work disturbed {', '.join(starved)}.",) if starved else ()
