"""Time of a whole evaluation from an empty store: 20 bodies of 15,000 vertices, all 380 pairs, 100 points, exact.

    python benchmarks/evaluation.py --threads 2

Built-in humans, refined.  ACD misses little, HKS misses far, and far misses need long exact distances.  Descriptors,
matches and distances are all counted.  `--threads` is the number of processes.
"""

from __future__ import annotations

import statistics
import time
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from measuring import options, write

from csm.data.humans import humans_set
from csm.data.store import Store
from csm.evaluation.engine import evaluate
from csm.evaluation.protocol import EvaluationProtocol

METHODS = ("acd", "hks")
VERTICES, SHAPES, POINTS, GOAL = 15000, 20, 100, 300.0


@dataclass(frozen=True)
class Row:
    """What was measured of one method; the error is in thousandths of the diameter."""

    variant: str
    vertices: int
    pairs: int
    error: float
    seconds: float
    goal: float


def main() -> None:
    chosen, protocol = options("evaluation", __doc__, METHODS, repeats=1), EvaluationProtocol(points=POINTS)
    rows = []
    with TemporaryDirectory() as made:
        humans = humans_set(f"refined_{VERTICES}", made)
        names = humans.names[-SHAPES:]
        shapes = [humans.load(name) for name in names]  # so that their refinement is not counted
        for method in METHODS:
            taken = []
            for number in range(chosen.repeats):
                store = Store(Path(made) / f"{method}{number}")
                begun = time.perf_counter()
                (found,) = evaluate(method, shapes, protocol, store=store, workers=chosen.threads)
                taken.append(time.perf_counter() - begun)
            error = 1e3 * found.summary["age"]
            rows.append(Row(method, VERTICES, len(found.rows), error, statistics.median(taken), GOAL))
            print(f"{method}: {len(found.rows)} pairs, error {error:.1f}, {rows[-1].seconds:.0f} s")
    write("evaluation", chosen, {"points": POINTS}, rows)


if __name__ == "__main__":
    main()
