"""Markdown tables of result rows; errors are printed in thousandths of the normaliser, as the ACD paper does."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeAlias

from csm.errors import DataError
from csm.evaluation.report import ResultRow

Published: TypeAlias = Mapping[tuple[str, str], float]
_TITLES = (
    "method",
    "train",
    "test",
    "AGE x1000",
    "exact %",
    "p95 x1000",
    "flips %",
    "pairs",
    "distance, normaliser",
    "seeds",
    "epochs",
)
_NORMALISERS = {"diameter": "of the diameter", "sqrt_area": "of sqrt(area)"}


def markdown_table(rows: Sequence[ResultRow]) -> str:
    """Return one line per row, with the protocol of each in the columns.

    The error is followed by its standard deviation over seeds, if there are several.
    """
    lines = [
        (
            row.method,
            row.train,
            row.test,
            error_cell(row),
            f"{100 * row.exact_match:.1f}",
            _optional(row.p95, 1000),
            _optional(row.flip_rate, 100),
            str(row.pairs),
            f"{row.distance}, {row.normaliser}",
            " ".join(map(str, row.seeds)) or "-",
            "-" if row.epochs is None else str(row.epochs),
        )
        for row in rows
    ]
    titles = (
        "method, train, test, AGE x1000, exact %, p95 x1000, flips %, pairs, distance and normaliser, seeds, epochs"
    )
    return _markdown([title.replace(" and ", ", ") for title in titles.split(", ")], lines)


def paper_table(rows: Sequence[ResultRow], published: Published) -> str:
    """Return the paper's errors beside ours: per method a line of the paper, if it has the method, and one of ours.

    Parameters
    ----------
    rows
        Of one distance and normaliser, at most one per method and test; there is one column per test.
    published
        The paper's error, as a fraction of the normaliser, for (method, test); a pair that is absent is printed as "-".

    Raises
    ------
    DataError
        If the rows cannot stand in one table.
    """
    kinds = {(row.distance, row.normaliser) for row in rows}
    cells = {(row.method, row.test): error_cell(row) for row in rows}
    if len(kinds) != 1 or len(cells) != len(rows):
        raise DataError(
            f"{len(rows)} rows of {len(cells)} methods and tests with {len(kinds)} kinds of distance; "
            "a table beside the paper takes one kind and each method and test once"
        )
    methods, tests = (list(dict.fromkeys(key[i] for key in cells)) for i in (0, 1))
    lines = []
    for method in methods:
        paper = [published.get((method, test)) for test in tests]
        if any(value is not None for value in paper):
            lines.append((method, "paper", *(_optional(value, 1000) for value in paper)))
        lines.append((method, "ours", *(cells.get((method, test), "-") for test in tests)))
    distance, normaliser = kinds.pop()
    return _markdown([f"AGE x1000 {_NORMALISERS[normaliser]}, {distance}", "", *tests], lines)


def error_cell(row: ResultRow) -> str:
    """Return the error in thousandths, such as "9.7 ± 0.3"."""
    spread = "" if row.age_std is None else f" ± {1000 * row.age_std:.1f}"
    return f"{1000 * row.age:.1f}{spread}"


def _optional(value: float | None, factor: float) -> str:
    return "-" if value is None else f"{factor * value:.1f}"


def _markdown(titles: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    head = ["| " + " | ".join(titles) + " |", "|" + "---|" * len(titles)]
    return (
        "\n".join([*head, *("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)])
        + "\n"
    )
