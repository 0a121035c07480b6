"""The markdown tables: what stands where."""

from __future__ import annotations

from csm.evaluation.tables import markdown_table
from tests.evaluation.test_report import row


def cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.strip("|").split("|")]


def test_markdown_has_one_line_per_row_and_states_the_protocol() -> None:
    lines = markdown_table([row(), row(train="none", seeds=(), epochs=None, age_std=None)]).splitlines()
    head, _, first, second = map(cells, lines)
    found = dict(zip(head, first, strict=True))
    assert (found["AGE x1000"], found["exact %"], found["pairs"]) == ("9.7 ± 0.3", "61.0", "380")
    assert found["distance, normaliser"] == "exact, diameter"
    assert (found["matching"], found["seeds"], found["epochs"]) == ("nearest", "0 1 2", "50")
    assert dict(zip(head, second, strict=True))["AGE x1000"] == "9.7"
    assert dict(zip(head, second, strict=True))["seeds"] == "-"


def test_a_bar_in_a_name_does_not_break_the_table() -> None:
    line = markdown_table([row(method="a|b", matching="argmax")]).splitlines()[2]
    assert line.startswith("| a\\|b | argmax |")
