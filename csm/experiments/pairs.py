"""The pairs of a test set one by one: a table that begins with the worst, and meshes to turn around."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from csm._counts import counted
from csm._types import FloatArray
from csm.evaluation.engine import evaluate
from csm.evaluation.results import PairRow
from csm.experiments.testing import Tested
from csm.matching.both import match_both_ways
from csm.mesh.shape import Mesh
from csm.viewer.camera import View, guess_up
from csm.viewer.colors import position_colors, pull_colors
from csm.viewer.html import Panel, Section, Table, Viewer, report_html, write_html

POINTS = 800
"""How many points of a pair are measured to colour its meshes, unless all are wanted."""

_LINES = 20


def worst_first(tested: Tested) -> list[PairRow]:
    """Return the pairs of a test set by their mean error, the greatest first."""
    return sorted(tested.evaluation.rows, key=lambda row: row.age, reverse=True)


def pairs_table(tested: Tested) -> Table:
    """Write the worst pairs as a table, with the mean errors and the flips behind it."""
    rows = worst_first(tested)
    lines = [
        (
            row.source,
            row.target,
            f"{1000 * row.age:.1f}",
            f"{1000 * row.p95:.1f}",
            f"{100 * row.exact:.1f} %",
            "-" if row.flip is None else f"{100 * row.flip:.1f} %",
        )
        for row in rows[:_LINES]
    ]
    shown = f"The {len(lines)} worst of {len(rows)} pairs" if len(rows) > _LINES else f"All {len(rows)} pairs"
    unit = f"errors in thousandths of the {tested.evaluation.protocol.normaliser}"
    columns = ("source", "target", "mean error", "95 % within", "exact", "left-right flips")
    return Table(columns, lines, f"{tested.label}. {shown}, the worst first; {unit}.")


def worst_line(tested: Tested) -> str:
    """Name the worst pair of a test set in a line."""
    rows = worst_first(tested)
    worst, unit = rows[0], f"thousandths of the {tested.evaluation.protocol.normaliser}"
    flips = f", {100 * worst.flip:.0f} % of its points left-right flipped" if worst.flip else ""
    pair = f"{worst.source} to {worst.target} with {1000 * worst.age:.1f} {unit}{flips}"
    return f"worst of {counted(len(rows), 'pair')} of {tested.label}: {pair}"


def common_view(tested: Tested) -> View:
    """Look at the shapes of a test set as `view_of_most` does."""
    return view_of_most(tested.shapes.load(name).mesh for name in tested.names)


def view_of_most(meshes: Iterable[Mesh]) -> View:
    """Look at meshes with the axis up that is longest in most of them; arms spread wide mislead only one."""
    ((most_common, _),) = Counter(map(guess_up, meshes)).most_common(1)
    return View(up=most_common)


def pair_viewer(tested: Tested, row: PairRow, view: View, what: str, *, errors: FloatArray | None = None) -> Viewer:
    """Show one pair as it was matched, with errors, confidence and descriptors.

    Parameters
    ----------
    tested, row
        The test set and the pair.
    view
        Where the viewer stands.
    what
        The pair in words, such as "the worst pair".
    errors
        What `shown_errors` returns, if it was asked before.
    """
    source, target = (tested.shapes.load(name).mesh for name in (row.source, row.target))
    here, there = (tested.method.describe(mesh, tested.store) for mesh in (source, target))
    found = match_both_ways(tested.matcher, here, there).forward
    forward = found.vertex_map
    how = f"errors are heat-method distances at up to {POINTS} points, each with its surroundings"
    reference, normaliser = position_colors(target, up=view.up), tested.row.normaliser
    first = Panel(
        source,
        pull_colors(reference, forward.indices),
        to_reference=forward.indices,
        errors=shown_errors(tested, row, source) if errors is None else errors,
        confidence=None if found.confidence is None else found.confidence.values,
        features=np.asarray(here.features),
    )
    caption = f"{tested.label}: {source.name} to {target.name}, {what} ({1000 * row.age:.1f} thousandths of the "
    return Viewer(
        [first, Panel(target, reference, features=np.asarray(there.features))],
        reference=1,
        view=view,
        error_label=f"geodesic error, fraction of the {normaliser}",
        confidence_label="confidence: the probability that the partner is near the truth",
        caption=f"{caption}{normaliser}); {how}",
    )


def worst_viewers(tested: Tested, count: int, view: View) -> list[Viewer]:
    """Show the worst pairs of a test set, the worst first."""
    words = ("the worst pair", "the second worst pair", "the third worst pair")
    return [
        pair_viewer(tested, row, view, words[i] if i < len(words) else f"number {i + 1} of the worst pairs")
        for i, row in enumerate(worst_first(tested)[:count])
    ]


def write_pairs(path: Path, tested: Tested) -> None:
    """Write a page with the pairs of one test set, the worst first, and the worst one to turn around."""
    blocks: list[Table | Viewer] = [pairs_table(tested), *worst_viewers(tested, 1, common_view(tested))]
    title = f"{tested.row.method} on {tested.label}"
    write_html(path, report_html(title, [Section("Pairs, the worst first", blocks)], lead=tested.row.protocol))


def shown_errors(tested: Tested, row: PairRow, source: Mesh) -> FloatArray:
    """Return errors to look at, shape (n_vertices,): some points are measured, and what lies near one takes its error.

    All vertices would take as long as the test itself.
    """
    return spread(source, vertex_errors(tested, (row.source, row.target), source.n_vertices, POINTS))


def vertex_errors(tested: Tested, pair: tuple[str, str], n_vertices: int, points: int | None = None) -> FloatArray:
    """Measure one pair by the heat method, at every vertex with known truth or at so many points.

    Returns
    -------
    FloatArray
        Shape (n_vertices,), for the vertices of the source; not a number elsewhere.
    """
    protocol = replace(
        tested.evaluation.protocol, pairs=(pair,), sample=None, points=points, exact_points=None, distance="heat"
    )
    (again,) = evaluate(
        tested.method,
        tested.shapes,
        protocol,
        matching=tested.matcher,
        names=pair,
        store=tested.store,
        workers=1,
        keep_pairs=True,
        progress=False,
    )
    errors = np.full(n_vertices, np.nan)
    errors[again.pairs[0].points.source] = again.errors
    return errors


def spread(mesh: Mesh, values: FloatArray) -> FloatArray:
    """Give vertices without a value that of the nearest one that has it, up to twice the usual distance of these."""
    known = np.isfinite(values)
    if known.all() or not known.any():
        return values
    away, nearest = cKDTree(mesh.vertices[known]).query(mesh.vertices)
    near = away <= 2 * np.sqrt(mesh.area / known.sum())
    filled: FloatArray = np.where(near, values[known][nearest], np.nan)
    return filled
