"""Damages small valid files of every format and reads them, each in a process with limits.

    python -m tests.fuzz.fuzz_readers --minutes 30 --seed 0

A finding is an exception that is no `CsmError`, a process that dies, a warning, more than a second of processor time
(or 20 by the clock) or more than 1 GB.
Findings are kept in the folder `--out` for replay: `python -m tests.fuzz.fuzz_readers --replay FILE...`.  Needs POSIX.
"""

from __future__ import annotations

import argparse
import collections
import os
import random
import signal
import sys
import tempfile
import time
import warnings
from collections.abc import Sequence
from pathlib import Path

from csm.errors import CsmError
from csm.mesh.correspondence import Direction
from csm.mesh.io import count_vertices, read_labels, read_mesh, read_polygons
from tests.fuzz.mutations import mutated
from tests.fuzz.seeds import seeds

MEMORY = 1 << 30
SECONDS = 1.0
BATCH = 200
HDF5_SHARE = 0.1
"""How many of the HDF5 files are kept, since each takes as long as hundreds of others."""
SOUND, REFUSED, FOUND = 0, 1, 2


def attempt(path: Path) -> tuple[int, str]:
    """Read a file in every way; return whether it was read, refused in a sentence, or is a finding, and why."""
    outcome = SOUND
    readers = {
        "read_polygons": lambda: read_polygons(path, choose="all"),
        "read_mesh": lambda: read_mesh(path),
        "count_vertices": lambda: count_vertices(path),
        "read_labels": lambda: read_labels(path, direction=Direction.SHAPE_TO_TEMPLATE, base=0, n_to=9),
    }
    if path.suffix == ".mat" and _is_hdf5(path.read_bytes()):
        del readers["read_mesh"], readers["count_vertices"]  # a process each, with nothing that the others lack
    for name, read in readers.items():
        start = _seconds()
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            try:
                read()
            except CsmError as error:
                outcome = REFUSED if name == "read_polygons" else outcome
                if str(path) not in str(error) or "\n" in str(error):
                    return FOUND, f"{name}: a message without the file's name or of several lines: {error}"
            except Exception as error:
                return FOUND, f"{name}: {type(error).__name__}: {error}"
        if caught:
            return FOUND, f"{name}: warning: {caught[0].message}"
        if _seconds() - start > SECONDS:
            return FOUND, f"{name}: {_seconds() - start:.1f} s"
    return outcome, ""


def _seconds() -> float:
    """Return the processor time of this process and of those it has waited for."""
    return sum(os.times()[:4])


def _is_hdf5(data: bytes) -> bool:
    return b"\x89HDF" in data[:520]


def in_child(paths: Sequence[Path]) -> list[tuple[int, str]]:
    """Do `attempt` for files in a forked process with limits of memory and time; after a death, in another one."""
    receive, send = os.pipe()
    child = os.fork()
    if child == 0:
        _limit()
        with os.fdopen(send, "w", buffering=1, errors="replace") as pipe:
            for path in paths:
                signal.alarm(20)
                outcome, why = attempt(path)
                pipe.write(f"{outcome} {' '.join(why.split())[:2000]}\n")
        os._exit(0)
    os.close(send)
    with os.fdopen(receive) as pipe:
        lines = [line.rstrip("\n").partition(" ") for line in pipe]
    _, status = os.waitpid(child, 0)
    done = [(int(outcome), why) for outcome, _, why in lines]
    if len(done) < len(paths):
        how = signal.Signals(os.WTERMSIG(status)).name if os.WIFSIGNALED(status) else f"status {status >> 8}"
        done.append((FOUND, f"the process died: {how}"))
        done += in_child(paths[len(done) :]) if len(done) < len(paths) else []
    return done


def _limit() -> None:
    import resource  # of POSIX only

    if sys.platform == "linux":
        used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY, used + MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)


def run(minutes: float, seed: int, out: Path) -> collections.Counter[str]:
    """Fuzz for some minutes; return how often what came out, findings by format."""
    rng, known, counts = random.Random(seed), list(seeds()), collections.Counter[str]()
    end = time.monotonic() + 60 * minutes
    with tempfile.TemporaryDirectory() as folder:
        while time.monotonic() < end:
            paths = []
            for i in range(BATCH):
                suffix, data = rng.choice(known)
                while _is_hdf5(data) and rng.random() > HDF5_SHARE:
                    suffix, data = rng.choice(known)
                paths.append(Path(folder) / f"{i}{suffix}")
                paths[-1].write_bytes(mutated(data, rng))
            for path, (outcome, why) in zip(paths, in_child(paths), strict=True):
                counts["tried"] += 1
                counts[("read", "refused", "findings")[outcome]] += 1
                if outcome == FOUND:
                    suffix = "".join(path.suffixes)
                    counts[f"findings in {suffix}"] += 1
                    out.mkdir(parents=True, exist_ok=True)
                    kept = out / f"{seed}-{counts['tried']:07d}{suffix}"
                    kept.write_bytes(path.read_bytes())
                    print(f"{kept}: {why}", flush=True)
                path.unlink()
    return counts


def main(arguments: Sequence[str] | None = None) -> int:
    """Run from the command line; the status is 1 if there are findings."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--minutes", type=float, default=30)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=Path("outputs/fuzz"))
    parser.add_argument("--replay", type=Path, nargs="+")
    chosen = parser.parse_args(arguments)
    if chosen.replay:
        found = [(path, *result) for path, result in zip(chosen.replay, in_child(chosen.replay), strict=True)]
        for path, outcome, why in found:
            print(f"{path}: {('read', 'refused', 'finding')[outcome]} {why}")
        return int(any(outcome == FOUND for _, outcome, _ in found))
    counts = run(chosen.minutes, chosen.seed, chosen.out)
    print(", ".join(f"{key}: {n}" for key, n in sorted(counts.items())))
    return int(counts["findings"] > 0)


if __name__ == "__main__":
    sys.exit(main())
