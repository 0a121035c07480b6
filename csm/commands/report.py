"""The page and the pictures that a test leaves: tables, curves, a map per test set, learned filters."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from csm._types import FloatArray, IntArray
from csm.commands.testing import Tested
from csm.data.shapeset import Shape
from csm.evaluation.protocol import evaluate_matches
from csm.evaluation.report import ResultRow, add_rows, write_curves_csv, write_rows, write_table_csv
from csm.evaluation.tables import markdown_table
from csm.viewer.camera import View, guess_up
from csm.viewer.colors import position_colors, pull_colors
from csm.viewer.figures import correspondence_figure, cqc_figure, figure_to_array, save_figure
from csm.viewer.html import Code, Figure, Panel, Section, Table, Text, Viewer, report_html, write_html


def conclude(tested: Sequence[Tested], folder: Path, results: str | None, notes: str) -> None:
    """Keep rows, curves, pictures and page of a test in a folder, print the table and where things are.

    Parameters
    ----------
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
    page = write_report(folder, f"{rows[0].method}, trained on {rows[0].train}", tested, notes)
    print(markdown_table(rows))
    print(f"table:        {folder / 'rows.json'}, rows.csv\nreport:       {page}")


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
        Section("Errors", [Table.from_markdown(markdown_table(rows)), Text(rows[0].protocol)]),
        Section("How many points are within an error", [Figure(figure_to_array(curves))]),
        Section("One map per test set", [block for figure, _ in maps for block in (figure,)]),
        Section("To turn around", [maps[-1][1]]),
        Section("How it was made", [Code(rows[0].command), Text(_origin(rows[0]))]),
    ]
    write_html(folder / "report.html", report_html(title, sections, lead=notes))
    return folder / "report.html"


def _origin(row: ResultRow) -> str:
    versions = ", ".join(f"{name} {version}" for name, version in row.versions.items())
    return f"Commit {row.commit}. {versions}."


def _view(shapes: Sequence[Shape]) -> View:
    """Look at a set with the axis up that is longest in most of its shapes; arms spread wide mislead only one."""
    ups = [guess_up(shape.mesh) for shape in shapes]
    ((most_common, _),) = Counter(ups).most_common(1)
    return View(up=most_common)


def _example(tested: Tested, folder: Path) -> tuple[Figure, Viewer]:
    """Draw the pair with the median error of a test set."""
    pairs = sorted(tested.evaluation.rows, key=lambda row: row.age)
    typical = pairs[len(pairs) // 2]
    by_name = {shape.name: shape for shape in tested.shapes}
    source, target = by_name[typical.source], by_name[typical.target]
    indices = tested.maps.between(source.name, target.name)
    errors = _vertex_errors(tested, source, target, indices)
    normaliser = tested.row.normaliser
    view = _view(tested.shapes)
    figure = correspondence_figure(source.mesh, target.mesh, indices, errors, view=view, normaliser=normaliser)
    save_figure(folder / f"map_{tested.label.replace(', ', '_')}.png", figure)
    caption = (
        f"{tested.label}: {source.name} to {target.name}, the pair with the median error of its set "
        f"({1000 * typical.age:.1f} thousandths of the {normaliser}); "
        "the colours of the errors are heat-method distances at all vertices"
    )
    reference = position_colors(target.mesh, up=view.up)
    viewer = Viewer(
        [
            Panel(source.mesh, pull_colors(reference, indices), to_reference=indices, errors=errors),
            Panel(target.mesh, reference),
        ],
        reference=1,
        view=view,
        error_label=f"geodesic error, fraction of the {normaliser}",
        caption=caption,
    )
    return Figure(figure_to_array(figure), caption), viewer


def _vertex_errors(tested: Tested, source: Shape, target: Shape, indices: IntArray) -> FloatArray:
    """Measure the map of one pair at every vertex with known truth, by the heat method; NaN elsewhere."""
    pair = (source.name, target.name)
    protocol = replace(tested.evaluation.protocol, pairs=(pair,), sample=None, points=None, distance="heat")
    again = evaluate_matches([source, target], lambda _a, _b: indices, protocol, progress=False)
    errors = np.full(source.mesh.n_vertices, np.nan)
    both = (source.truth.indices >= 0) & (target.truth.indices >= 0)
    errors[source.truth.indices[both]] = again.errors
    return errors
