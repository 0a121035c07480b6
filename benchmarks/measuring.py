"""What the benchmarks share: variants in turns, peaks of memory in fresh processes, the options and the result file."""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import torch

from csm import _peak
from csm.evaluation.provenance import provenance
from csm.mesh.io import atomic_path

Run = Callable[[], object]


def options(
    name: str, about: str | None, variants: Sequence[str], repeats: int, sizes: Sequence[int] = ()
) -> argparse.Namespace:
    """Read the command line and set PyTorch's threads."""
    parser = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--threads", type=int, default=torch.get_num_threads(), help="of PyTorch")
    parser.add_argument("--repeats", type=int, default=repeats, help="passes per variant")
    parser.add_argument("--out", type=Path, default=Path(f"results/benchmark_{name}.json"))
    if sizes:
        parser.add_argument("--sizes", type=int, nargs="+", default=list(sizes), help="numbers of vertices")
    parser.add_argument("--peak-of", choices=variants, help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    torch.set_num_threads(chosen.threads)
    return chosen


def seconds(run: Run) -> float:
    started = time.perf_counter()
    run()
    return time.perf_counter() - started


def median_milliseconds(runs: Mapping[str, Run], repeats: int) -> dict[str, float]:
    """Time the variants in turns, so that a busy machine slows all of them; return the median of each."""
    times: dict[str, list[float]] = {variant: [] for variant in runs}
    for _ in range(repeats):
        for variant, run in runs.items():
            times[variant].append(1e3 * seconds(run))
    return {variant: statistics.median(found) for variant, found in times.items()}


def peak_megabytes(variant: str, threads: int) -> float:
    """Measure in a fresh process of the same script, as the peak of a process never falls."""
    words = [sys.executable, sys.argv[0], "--threads", str(threads), "--peak-of", variant]
    return float(subprocess.run(words, check=True, capture_output=True, text=True).stdout)


def growth_megabytes(run: Run) -> float:
    """Return by how much one pass raises the peak of this process."""
    before = _peak.peak_megabytes()
    run()
    return _peak.peak_megabytes() - before


def write(name: str, chosen: argparse.Namespace, size: Mapping[str, float], rows: Sequence[Any]) -> None:
    """Write the rows with the size of the problem, the command and the versions."""
    sizes = f" --sizes {' '.join(map(str, chosen.sizes))}" if "sizes" in chosen else ""
    command = f"python benchmarks/{name}.py --threads {chosen.threads} --repeats {chosen.repeats}{sizes}"
    made = asdict(replace(provenance(), command=command))
    content = {**size, "threads": chosen.threads, "repeats": chosen.repeats, **made}
    with atomic_path(chosen.out) as temporary:
        temporary.write_text(json.dumps(content | {"rows": [asdict(row) for row in rows]}, indent=1) + "\n")
