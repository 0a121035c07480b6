"""The page and the pictures that a test leaves: tables, curves, a map per test set."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from csm.evaluation.report import ResultRow, add_rows, write_curves_csv, write_rows, write_table_csv
from csm.evaluation.tables import COLUMNS, table_lines
from csm.experiments.pairs import common_view, pair_viewer, pairs_table, vertex_errors, worst_viewers
from csm.experiments.testing import Tested
from csm.viewer.figures import correspondence_figure, cqc_figure, figure_to_array, save_figure
from csm.viewer.html import Code, Figure, Section, Table, Text, Viewer, report_html, write_html

_VIEWERS = 4  # of worst pairs, on a page


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
        Section("Worst pairs first", _worst(tested)),
        Section("A typical pair to turn around", [maps[-1][1]]),
        Section("How it was made", [Code(rows[0].command), Text(_origin(rows[0]))]),
    ]
    write_html(folder / "report.html", report_html(title, sections, lead=notes))
    return folder / "report.html"


def _origin(row: ResultRow) -> str:
    versions = ", ".join(f"{name} {version}" for name, version in row.versions.items())
    return f"Commit {row.commit}. {versions}."


def _example(tested: Tested, folder: Path) -> tuple[Figure, Viewer]:
    """Draw the pair with the median error of a test set."""
    pairs = sorted(tested.evaluation.rows, key=lambda row: row.age)
    typical = pairs[len(pairs) // 2]
    view = common_view(tested)
    source, target = (tested.shapes.load(name).mesh for name in (typical.source, typical.target))
    here, there = (tested.method.describe(mesh, tested.store) for mesh in (source, target))
    indices = tested.matcher(here, there).indices
    errors = vertex_errors(tested, (typical.source, typical.target), source.n_vertices)
    figure = correspondence_figure(source, target, indices, errors, view=view, normaliser=tested.row.normaliser)
    save_figure(folder / f"map_{tested.label.replace(', ', '_')}.png", figure)
    viewer = pair_viewer(tested, typical, view, "the pair with the median error of its set", errors=errors)
    return Figure(figure_to_array(figure), viewer.caption), viewer


def _worst(tested: Sequence[Tested]) -> list[Table | Viewer]:
    """Show the pairs of every set, worst first; the more sets there are, the fewer meshes of each."""
    count = max(1, _VIEWERS // len(tested))
    blocks: list[Table | Viewer] = []
    for one in tested:
        blocks += [pairs_table(one), *worst_viewers(one, count, common_view(one))]
    return blocks
