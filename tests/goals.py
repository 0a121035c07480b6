"""What csm set itself to reach in speed and memory, beside what the benchmarks in results/ found."""

from __future__ import annotations

import json
import operator
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

_HOLDS = {"at least": operator.ge, "at most": operator.le}
_WORST = {"at least": min, "at most": max}


@dataclass(frozen=True)
class Goal:
    """One goal.

    Parameters
    ----------
    what
        In words, with the unit.
    file
        The benchmark, ``results/benchmark_FILE.json``.
    column
        Of its rows.
    sense, bound
        "at least" or "at most", and the number.
    where
        Column -> value of the rows that count, all if empty; of several the worst one does.
    """

    what: str
    file: str
    column: str
    sense: str
    bound: float
    where: Mapping[str, Any] = field(default_factory=dict)

    def reached(self, results: Path) -> float:
        """Return the worst number that was measured."""
        kept = json.loads((results / f"benchmark_{self.file}.json").read_text(encoding="utf-8"))
        rows = [row for row in kept["rows"] if all(row[key] == value for key, value in self.where.items())]
        return float(_WORST[self.sense](row[self.column] for row in rows))

    def line(self, results: Path) -> str:
        """Return the goal as a line of a table."""
        found = self.reached(results)
        met = "yes" if _HOLDS[self.sense](found, self.bound) else "no"
        return f"| {self.what} | {self.sense} {self.bound:.4g} | {found:.4g} | {met} |"


def _eigensystems(work: str, one: float, two: float | None = None) -> list[Goal]:
    """Return the goals of one kind of eigensystem at two sizes on one thread, and on two."""
    several = ((one, "eigensystems", "one thread"), (two, "eigensystems_2", "two threads"))
    return [
        Goal(f"{work}, 6,899 and 15,000 vertices, {threads}: ratio", file, "ratio", "at least", bound, {"work": work})
        for bound, file, threads in several
        if bound is not None
    ]


_MILLION = "`acd_paper` and 128 functions of a million vertices, two threads"
_HUNDRED = "`acd_paper` and 128 functions of 100 thousand vertices, two threads"
_OF_MILLION, _OF_HUNDRED = {"vertices": 999_874}, {"vertices": 99_970}

GOALS = (
    *_eigensystems("acd_paper", 3, 5.5),
    *_eigensystems("acd_release", 2.5, 4.5),
    *_eigensystems("128 functions", 2),
    *_eigensystems("256 functions", 2),
    *_eigensystems("acd, against acd_paper", 1 / 1.2),
    Goal("checks in that time, `acd_paper`: %", "eigensystems", "check_share", "at most", 15, {"work": "acd_paper"}),
    Goal(f"{_MILLION}: s", "scale_million", "seconds", "at most", 480, _OF_MILLION),
    Goal(f"{_MILLION}: MB", "scale_million", "megabytes", "at most", 6000, _OF_MILLION),
    Goal(f"{_HUNDRED}: s", "scale", "seconds", "at most", 30, _OF_HUNDRED),
    Goal(f"{_HUNDRED}: MB", "scale", "megabytes", "at most", 1500, _OF_HUNDRED),
    Goal("step of training, float32: ratio", "step", "ratio", "at least", 1.6, {"variant": "float32, all rows"}),
    Goal("step of training, bfloat16: ratio", "step", "ratio", "at least", 4, {"variant": "bfloat16, all rows"}),
    Goal("all but the loss in that step: %", "step", "rest", "at most", 25, {"variant": "bfloat16, all rows"}),
    Goal("step with 50,000 template points: MB", "classes", "megabytes", "at most", 2000, {"classes": 50_000}),
    Goal(
        "nearest neighbours, share of the speed of the products alone",
        *("nearest", "of_products", "at least", 0.8, {"variant": "csm nearest"}),
    ),
    Goal("380 pairs at 15,000 vertices, exact distances, empty store: s", "evaluation", "seconds", "at most", 300),
    Goal("preparation of shapes, two processes: ratio", "preparation", "ratio", "at least", 6),
    Goal("`csm match refine=none` of two meshes: s", "match", "seconds", "at most", 6, {"variant": "refine=none"}),
    Goal(
        "match and refinement in Python, with the bases: s",
        *("match", "seconds", "at most", 3, {"variant": "in Python, again"}),
    ),
    Goal("any `--help`: s", "startup", "seconds", "at most", 0.5),
)


def table(results: Path) -> str:
    """Return all goals as a table."""
    head = ["| what | goal | reached | met |", "|---|---|---|---|"]
    return "\n".join([*head, *(goal.line(results) for goal in GOALS)]) + "\n"
