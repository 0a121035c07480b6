"""The page and the pictures that a test leaves: tables, curves, a map per test set."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from csm._types import FloatArray
from csm.evaluation.engine import evaluate
from csm.evaluation.report import ResultRow, add_rows, write_curves_csv, write_rows, write_table_csv
from csm.evaluation.tables import COLUMNS, table_lines
from csm.experiments.testing import Tested
from csm.mesh.shape import Mesh
from csm.viewer.camera import View, guess_up
from csm.viewer.colors import position_colors, pull_colors
from csm.viewer.figures import correspondence_figure, cqc_figure, figure_to_array, save_figure
from csm.viewer.html import Code, Figure, Panel, Section, Table, Text, Viewer, report_html, write_html


def write_results(tested: Sequence[Tested], folder: Path, results: str | Path | None, notes: str) -> Path:
    """Keep rows, curves, pictures and page of a test in a folder, and return the page.

    Parameters
    ----------
    tested
        The test sets, at least one.
    folder
        Gets ``rows.json``, ``rows.csv``, ``cqc.csv`` and what `write_report` writes.
    results
        A json that the rows are merged into as well, or None.
    notes
        See `write_report`.
    """
    rows = [t.row for t in tested]
    write_rows(folder / "rows.json", rows)
    write_table_csv(folder / "rows.csv", rows)
    write_curves_csv(folder / "cqc.csv", {t.label: t.evaluation for t in tested})
    if results:
        add_rows(results, rows)
    return write_report(folder, f"{rows[0].method}, trained on {rows[0].train}", tested, notes)


def write_report(folder: Path, title: str, tested: Sequence[Tested], notes: str = "") -> Path:
    """Write ``report.html``, ``cqc.png`` and a ``map_SET.png`` per test set into a folder; return the page.

    Parameters
    ----------
    folder
        Of the job.
    title
        Of the page.
    tested
        The test sets, at least one.
    notes
        A paragraph for the top of the page: what was trained on what.
    """
    rows = [t.row for t in tested]
    curves = cqc_figure({t.label: t.evaluation for t in tested}, normaliser=rows[0].normaliser)
    save_figure(folder / "cqc.png", curves)
    maps = [_example(t, folder) for t in tested]
    sections = [
        Section("Errors", [Table(COLUMNS, table_lines(rows)), Text(rows[0].protocol)]),
        Section("How many points are within an error", [Figure(figure_to_array(curves))]),
        Section("One map per test set", [figure for figure, _ in maps]),
        Section("To turn around", [maps[-1][1]]),
        Section("How it was made", [Code(rows[0].command), Text(_origin(rows[0]))]),
    ]
    write_html(folder / "report.html", report_html(title, sections, lead=notes))
    return folder / "report.html"


def _origin(row: ResultRow) -> str:
    versions = ", ".join(f"{name} {version}" for name, version in row.versions.items())
    return f"Commit {row.commit}. {versions}."


def _view(meshes: Sequence[Mesh]) -> View:
    """Look at a set with the axis up that is longest in most of its shapes; arms spread wide mislead only one."""
    ((most_common, _),) = Counter(map(guess_up, meshes)).most_common(1)
    return View(up=most_common)


def _example(tested: Tested, folder: Path) -> tuple[Figure, Viewer]:
    """Draw the pair with the median error of a test set."""
    pairs = sorted(tested.evaluation.rows, key=lambda row: row.age)
    typical = pairs[len(pairs) // 2]
    view = _view([tested.shapes.load(name).mesh for name in tested.names])
    source, target = (tested.shapes.load(name).mesh for name in (typical.source, typical.target))
    here, there = (tested.method.describe(mesh, tested.store) for mesh in (source, target))
    indices = tested.matcher(here, there).indices
    errors = vertex_errors(tested, (typical.source, typical.target), source.n_vertices)
    normaliser = tested.row.normaliser
    figure = correspondence_figure(source, target, indices, errors, view=view, normaliser=normaliser)
    save_figure(folder / f"map_{tested.label.replace(', ', '_')}.png", figure)
    caption = (
        f"{tested.label}: {source.name} to {target.name}, the pair with the median error of its set "
        f"({1000 * typical.age:.1f} thousandths of the {normaliser}); "
        "the colours of the errors are heat-method distances at all vertices"
    )
    reference = position_colors(target, up=view.up)
    viewer = Viewer(
        [
            Panel(source, pull_colors(reference, indices), to_reference=indices, errors=errors),
            Panel(target, reference),
        ],
        reference=1,
        view=view,
        error_label=f"geodesic error, fraction of the {normaliser}",
        caption=caption,
    )
    return Figure(figure_to_array(figure), caption), viewer


def vertex_errors(tested: Tested, pair: tuple[str, str], n_vertices: int) -> FloatArray:
    """Measure one pair at every vertex with known truth, by the heat method; shape (n_vertices,), NaN elsewhere."""
    protocol = replace(
        tested.evaluation.protocol, pairs=(pair,), sample=None, points=None, exact_points=None, distance="heat"
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
