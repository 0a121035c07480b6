"""Time of ``csm match`` as a user waits for it: whole processes, from two files and an empty store to the written maps.

    python benchmarks/match.py --repeats 5

The meshes are two of the built-in humans, 6,899 vertices each.  The ways to match take turns; the time is the median,
the ratio that of the reference over it.  "again" is with all that the first run left in the store; "in Python, again"
is the default once more, by a call in a process that has everything loaded.
"""

from __future__ import annotations

import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from measuring import options, seconds, write

import csm
from csm.data.humans import Humans
from csm.mesh.io import write_mesh

PAIR = "s00_p00", "s01_p02"
REFERENCE, IN_PYTHON = "refine=none", "in Python, again"
WAYS = {
    REFERENCE: [REFERENCE],
    "default": [],
    "default, again": [],
    "model=humans": ["model=humans"],
    "model=auto": ["model=auto"],
    "model=auto, again": ["model=auto"],
    IN_PYTHON: [],
}


@dataclass(frozen=True)
class Row:
    """What was measured of one way to match."""

    variant: str
    seconds: float
    processor_seconds: float
    ratio: float


def processor_seconds() -> float:
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    return spent.ru_utime + spent.ru_stime


def run(folder: Path, store: Path, words: list[str]) -> tuple[float, float]:
    """Return the seconds of one match, and what the processor spent on it."""
    files = [str(folder / f"{name}.off") for name in PAIR]
    line = [sys.executable, "-m", "csm", "match", *files, *words, f"out={folder / 'out'}", "overwrite=true"]
    environment = os.environ | {"CSM_CACHE": str(store)}
    before = processor_seconds()
    taken = seconds(lambda: subprocess.run(line, check=True, capture_output=True, env=environment))
    return taken, processor_seconds() - before


def call(humans: Humans, store: Path) -> tuple[float, float]:
    """Return the seconds of one call of `csm.match` with a store that has all it needs, and the processor's."""
    pair = [humans.mesh(name) for name in PAIR]
    before = time.process_time()
    taken = seconds(lambda: csm.match(*pair, store=store))
    return taken, time.process_time() - before


def measure(repeats: int) -> list[Row]:
    humans, times = csm.load_humans(), {way: list[tuple[float, float]]() for way in WAYS}
    for _ in range(repeats):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            for shape in PAIR:
                write_mesh(folder / f"{shape}.off", humans.mesh(shape))
            for number, (way, words) in enumerate(WAYS.items()):
                number -= way.endswith("again")  # in the store of the way before it
                if way == IN_PYTHON:
                    times[way].append(call(humans, folder / "store1"))
                else:
                    times[way].append(run(folder, folder / f"store{number}", words))
    median = {way: [statistics.median(each) for each in zip(*found, strict=True)] for way, found in times.items()}
    return [Row(way, *median[way], ratio=median[REFERENCE][0] / median[way][0]) for way in WAYS]


def main() -> None:
    chosen = options("match", __doc__, list(WAYS), repeats=5)
    rows = measure(chosen.repeats)
    print(f"{'':<20}{'s':>8}{'processor s':>14}{'ratio':>8}")
    for row in rows:
        print(f"{row.variant:<20}{row.seconds:>8.1f}{row.processor_seconds:>14.1f}{row.ratio:>8.2f}")
    write("match", chosen, {"n": csm.load_humans().mesh(PAIR[0]).n_vertices}, rows)


if __name__ == "__main__":
    main()
