"""Tables of result rows; errors are printed in thousandths of the normaliser, as the ACD paper does."""

from __future__ import annotations

from collections.abc import Sequence

from csm.evaluation.report import ResultRow

COLUMNS = (
    "method",
    "matching",
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
"""Titles of the columns of `table_lines`."""

LEGEND = (
    "AGE: mean geodesic error; p95: 95 % of the points err less; both in thousandths of the normaliser. exact: points "
    "at the true vertex. flips: points nearer to the mirrored truth."
)
"""What a printed table does not say in its titles."""


def table_lines(rows: Sequence[ResultRow]) -> list[tuple[str, ...]]:
    """Return the cells of a table with one line per row, in the order of `COLUMNS`.

    The error is followed by its standard deviation over seeds, if there are several.
    """
    return [
        (
            row.method,
            row.matching,
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


def markdown_table(rows: Sequence[ResultRow]) -> str:
    """Return the table of `table_lines` in markdown."""
    lines = [COLUMNS, ("---",) * len(COLUMNS), *table_lines(rows)]
    cells = [[cell.replace("|", "\\|") for cell in line] for line in lines]
    return "".join("| " + " | ".join(line) + " |\n" for line in cells)


def error_cell(row: ResultRow) -> str:
    """Return the error in thousandths, such as "9.7 ± 0.3"."""
    spread = "" if row.age_std is None else f" ± {1000 * row.age_std:.1f}"
    return f"{1000 * row.age:.1f}{spread}"


def _optional(value: float | None, factor: float) -> str:
    return "-" if value is None else f"{factor * value:.1f}"
