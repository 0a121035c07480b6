"""Time until commands answer: a new process each, files warm.

    python benchmarks/startup.py --repeats 5

`--help` of most commands.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
from dataclasses import dataclass

from measuring import options, seconds, write

COMMANDS = ("check", "clean", "describe", "match", "prepare", "train", "evaluate", "matrix", "reproduce", "bench")
WAYS = {"csm --help": ["--help"], **{f"csm {name} --help": [name, "--help"] for name in COMMANDS}}
GOAL = 0.5


@dataclass(frozen=True)
class Row:
    """The median of one way to call csm."""

    variant: str
    seconds: float
    goal: float


def main() -> None:
    chosen = options("startup", __doc__, list(WAYS), repeats=5)

    def call(words: list[str]) -> None:
        subprocess.run([sys.executable, "-m", "csm", *words], check=True, capture_output=True)

    rows = []
    for way, words in WAYS.items():
        taken = [seconds(lambda words=words: call(words)) for _ in range(chosen.repeats + 1)]  # type: ignore[misc]
        rows.append(Row(way, statistics.median(taken[1:]), GOAL))
        print(f"{way:<28}{rows[-1].seconds:>8.2f} s")
    write("startup", chosen, {}, rows)


if __name__ == "__main__":
    main()
