"""Table 1: the mean error of nearest-neighbour matching by every handcrafted descriptor, beside the paper's."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from matplotlib.figure import Figure

from csm.data.datasets import find_set
from csm.data.folderset import FolderSet
from csm.descriptors.presets import preset
from csm.errors import ConfigError, DataError
from csm.evaluation.protocol import Pair, Protocol
from csm.studies.bodies import RIVALS, label
from csm.studies.cells import Cell, fill_cells
from csm.studies.matching import Rules
from csm.studies.published import AGE, ASSUMED, SETS, family
from csm.studies.study import Context, Findings
from csm.viewer.comparisons import dots_figure
from csm.viewer.figures import save_figure

_log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Column:
    """The cells of one set, and what to know of its pairs."""

    cells: Mapping[str, Cell]
    note: str


def run(
    context: Context,
    *,
    sets: Sequence[str] = tuple(SETS),
    descriptors: Sequence[str] = RIVALS,
    points: int | None = None,
    exact_points: int | None = 100,
    sample: int | None = None,
) -> Findings:
    """Measure every descriptor on every set and put the numbers beside the paper's.

    Parameters
    ----------
    context
        Where data and artefacts are; cells that are in its folder are not made again.
    sets
        Out of `csm.studies.published.SETS`; one whose folder is not there is left out, which the notes say.
    descriptors
        Names of presets.
    points
        How many template points are measured, drawn; None for all.
    exact_points
        How many of these are measured exactly on each shape (see `csm.studies.measure`); None for all.
    sample
        How many of a set's pairs are drawn; None for all.

    Raises
    ------
    ConfigError
        If a set or descriptor is unknown or a count is below 1.
    DataError
        If none of the sets is there.
    """
    columns = measure_sets(
        context, sets=sets, descriptors=descriptors, points=points, exact_points=exact_points, sample=sample
    )
    rows = [_row(name, columns) for name in descriptors]
    shown = ["descriptor"]
    for key in columns:
        title = SETS[key].title
        shown += [f"{title} paper", f"{title} ours", f"{title} ranks"]
    path = context.out / "table1.png"
    save_figure(path, _draw(rows, columns))
    title = "Mean geodesic error of nearest-neighbour matching, in thousandths of the diameter."
    return Findings("table1", title, (*shown, "assumed"), rows, _notes(columns, sets), (path,))


def measure_sets(
    context: Context,
    *,
    sets: Sequence[str],
    descriptors: Sequence[str],
    points: int | None,
    exact_points: int | None,
    sample: int | None,
) -> dict[str, Column]:
    """Return the cells of the sets that are below the context's root; parameters and errors as for `run`."""
    unknown = [name for name in sets if name not in SETS]
    if unknown or not sets:
        raise ConfigError(f"table1: sets {', '.join(unknown) or 'are empty'}; choose out of {', '.join(SETS)}")
    if not descriptors or (exact_points is not None and exact_points < 1):
        raise ConfigError(f"table1: wanted descriptors and exact_points from 1, got {descriptors}, {exact_points}")
    chosen = {name: preset(name) for name in descriptors}
    columns: dict[str, Column] = {}
    why = ""
    for key in sets:
        try:
            shapes = find_set(context.root, SETS[key].folder)
        except DataError as error:
            why = str(error)
            _log.warning("%s is left out: %s", SETS[key].title, why)
            continue
        protocol = Protocol(usable_pairs(key, shapes), sample, points, context.seed)
        pairs = protocol.choose(shapes.names)
        cells = fill_cells(context, shapes, pairs, chosen, Rules(protocol, exact_points))
        columns[key] = Column(cells, _pairs_note(key, shapes, protocol, next(iter(cells.values()))))
    if not columns:
        raise DataError(f"none of the sets {', '.join(sets)} is there; {why}")
    return columns


def usable_pairs(key: str, shapes: FolderSet) -> list[Pair]:
    """Return the pairs of a set that the table is about: those with ground truth; of FAUST those of one person.

    Raises
    ------
    DataError
        If there are none, because the list of pairs or the maps are missing.
    """
    pairs = [(a, b) for a, b in shapes.mapped_pairs if key != "faust" or a[:-1] == b[:-1]]
    if not pairs:
        raise DataError(f"{shapes.root}: no pair of test_pairs.txt has ground truth here; `csm check` tells what lacks")
    return pairs


def ranks(values: Mapping[str, float]) -> dict[str, int]:
    """Return the place of each preset, from 1, among the families of the paper other than its own.

    Examples
    --------
    >>> ranks({"acd_paper": 0.2, "hks": 0.1, "wks": 0.3, "acd_release": 0.05})
    {'acd_paper': 2, 'hks': 2, 'wks': 3, 'acd_release': 1}
    """
    best: dict[str, float] = {}
    for name, value in values.items():
        if family(name) in AGE:
            best[family(name)] = min(value, best.get(family(name), value))
    return {
        name: 1 + sum(other < value for kind, other in best.items() if kind != family(name))
        for name, value in values.items()
    }


def _row(name: str, columns: Mapping[str, Column]) -> dict[str, Any]:
    kind = family(name)
    row: dict[str, Any] = {"descriptor": name, "family": kind, "assumed": ASSUMED.get(kind, "")}
    for key, column in columns.items():
        title, cell = SETS[key].title, column.cells[name]
        place = ranks({other: c.age for other, c in column.cells.items()})[name]
        compared = {family(other) for other in column.cells} & set(AGE)
        paper = AGE.get(kind, {}).get(key)
        paper_place = None if paper is None else 1 + sum(AGE[other][key] < paper for other in compared - {kind})
        row[f"{title} paper"] = paper
        row[f"{title} ours"] = f"{1000 * cell.age:.1f} ± {1000 * cell.std:.1f}"
        row[f"{title} ranks"] = f"{paper_place or '-'} / {place}"
        row[key] = {
            **cell.summary,
            "std": cell.std,
            "uncertainty": cell.uncertainty,
            "paper": None if paper is None else paper / 1000,
            "rank": place,
            "paper_rank": paper_place,
            "made": cell.made.commit,
        }
    return row


def _draw(rows: Sequence[Mapping[str, Any]], columns: Mapping[str, Column]) -> Figure:
    """Plot ours and the paper's errors, a panel per set; a family that the paper has not is no dot there."""
    panels = {
        f"mean error on {SETS[key].title}": {
            "paper": [row[f"{SETS[key].title} paper"] or float("nan") for row in rows],
            "ours": [1000 * row[key]["age"] for row in rows],
        }
        for key in columns
    }
    return dots_figure([label(row["descriptor"]) for row in rows], panels)


def _notes(columns: Mapping[str, Column], wanted: Sequence[str]) -> tuple[str, ...]:
    cells = [cell for column in columns.values() for cell in column.cells.values()]
    absent = [SETS[key].title for key in wanted if key not in columns]
    notes = [
        "Each cell has the mean error over all points of all pairs ± the standard deviation over pairs. Ranks are the "
        "paper's / ours, each among the families of this table, of which ACD stands in several settings. Equal ranks "
        "of the paper are ties.",
        _distances_note(cells),
        *(column.note for column in columns.values()),
        "Assumed: what of a descriptor no source says, so that its row is our best guess at what was run; the "
        "parameters are those of the docstrings.",
    ]
    if absent:
        notes.append(f"Not below the folder of the data, so left out: {', '.join(absent)}.")
    return tuple(notes)


def _distances_note(cells: Sequence[Cell]) -> str:
    n = cells[0].question["exact_points"]
    if n is None:
        return "All distances are exact."
    worst = max(cell.uncertainty for cell in cells)
    return (
        f"On each target, {n} template points are measured by exact geodesics; the others by shortest paths along "
        "edges times the ratio of exact to edge distances over those points, one ratio per descriptor and target. "
        f"The standard error of a mean that is due to this is at most {1000 * worst:.2f} thousandths. The rates of "
        "left-right flips in the json are over the points measured exactly."
    )


def _pairs_note(key: str, shapes: FolderSet, protocol: Protocol, cell: Cell) -> str:
    usable, n = len(usable_pairs(key, shapes)), int(cell.summary["pairs"] or 0)
    drawn = "" if protocol.sample is None or protocol.sample >= usable else f", of which {protocol.sample} were drawn"
    which = {
        "faust": f"{usable} pairs of two poses of one person among the {len(shapes.pairs)} of test_pairs.txt",
        "shrec19": f"the {usable} of {len(shapes.pairs)} pairs whose ground truth is there ({len(shapes.mapped)} of "
        f"{len(shapes.names)} shapes have maps)",
        "tosca": f"{usable} pairs within the {len({entry.template for entry in shapes.entries})} classes of "
        f"{len(shapes.names)} shapes",
    }[key]
    lost = "".join(f" {name} is left out: {why}." for name, why in cell.failures.items())
    points = "all" if protocol.points is None else f"{protocol.points} drawn"
    return f"{SETS[key].title}: {which}{drawn}; {n} pairs measured at {points} template points known on both.{lost}"
