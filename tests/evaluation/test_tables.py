"""The markdown tables: what stands where."""

from __future__ import annotations

import pytest

from csm.errors import DataError
from csm.evaluation.tables import markdown_table, paper_table
from tests.evaluation.test_report import row


def cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.strip("|").split("|")]


def test_markdown_has_one_line_per_row_and_states_the_protocol() -> None:
    lines = markdown_table([row(), row(train="none", seeds=(), epochs=None, age_std=None)]).splitlines()
    head, _, first, second = map(cells, lines)
    found = dict(zip(head, first, strict=True))
    assert (found["AGE x1000"], found["exact %"], found["pairs"]) == ("9.7 ± 0.3", "61.0", "380")
    assert found["distance, normaliser"] == "exact, diameter"
    assert dict(zip(head, second, strict=True))["AGE x1000"] == "9.7"


def test_the_paper_stands_above_ours() -> None:
    rows = [row(), row(test="FAUST 10000", age=0.0151), row(method="ACD", train="none", age=0.08)]
    table = paper_table(rows, {("CSMCNN", "FAUST 6890"): 0.010, ("CSMCNN", "FAUST 10000"): 0.015})
    head, _, *lines = [cells(line) for line in table.splitlines()]
    assert head[2:] == ["FAUST 6890", "FAUST 10000"]
    assert "diameter" in head[0]
    assert lines == [
        ["CSMCNN", "paper", "10.0", "15.0"],
        ["CSMCNN", "ours", "9.7 ± 0.3", "15.1 ± 0.3"],
        ["ACD", "ours", "80.0 ± 0.3", "-"],
    ]


def test_different_distances_do_not_share_a_table() -> None:
    with pytest.raises(DataError, match="one kind"):
        paper_table([row(), row(test="b", distance="edge")], {})
