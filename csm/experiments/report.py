"""The page and the pictures that a test leaves: tables, curves, a map per test set."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from csm._counts import counted
from csm.evaluation.report import ResultRow, add_rows, write_curves_csv, write_rows, write_table_csv
from csm.evaluation.tables import COLUMNS, table_lines
from csm.experiments.pairs import common_view, pair_viewer, pairs_table, shown_errors, worst_viewers
from csm.experiments.testing import Tested
from csm.viewer.comparisons import training_figure
from csm.viewer.figures import correspondence_figure, cqc_figure, figure_to_array, save_figure
from csm.viewer.html import Code, Figure, Section, Table, Text, Viewer, report_html, write_html

if TYPE_CHECKING:  # a test needs no Lightning
    from csm.experiments.training import Trained

_VIEWERS = 4  # of worst pairs, on a page


def write_results(
    tested: Sequence[Tested], folder: Path, results: str | Path | None, notes: str, more: Sequence[Section] = ()
) -> Path:
    """Keep rows, curves, pictures and page of a test in a folder, and return the page.

    Parameters
    ----------
    tested
        The test sets, at least one.
    folder
        Gets ``rows.json``, ``rows.csv``, ``cqc.csv`` and what `write_report` writes.
    results
        A json that the rows are merged into as well, or None.
    notes, more
        See `write_report`.
    """
    rows = [t.row for t in tested]
    write_rows(folder / "rows.json", rows)
    write_table_csv(folder / "rows.csv", rows)
    write_curves_csv(folder / "cqc.csv", {t.label: t.evaluation for t in tested})
    if results:
        add_rows(results, rows)
    return write_report(folder, f"{rows[0].method}, trained on {rows[0].train}", tested, notes, more)


def write_report(
    folder: Path, title: str, tested: Sequence[Tested], notes: str = "", more: Sequence[Section] = ()
) -> Path:
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
    more
        Sections before the last one, such as `training_section`.
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
        *more,
        Section("How it was made", [Code(rows[0].command), Text(_origin(rows[0]))]),
    ]
    write_html(folder / "report.html", report_html(title, sections, lead=notes))
    return folder / "report.html"


def training_section(trained: Trained) -> Section:
    """Return how a training went: its size, its duration, and the curves of its losses and errors."""
    epochs = trained.module.hparams["training"]["epochs"]
    text = f"{trained.parameters:,} parameters; {counted(epochs, 'epoch')} in {trained.seconds / 60:.1f} minutes"
    pictures = [Figure(figure_to_array(training_figure(trained.curves)))] if trained.curves else []
    return Section("How the training went", [Text(f"{text}."), *pictures])


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
    errors = shown_errors(tested, typical, source)
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
