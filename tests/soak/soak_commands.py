"""A matrix and a sweep under kills at random moments: started again, they end as the ones that were left in peace."""

from __future__ import annotations

import csv
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from csm.evaluation.report import read_rows
from tests.commands.test_pipeline import SMALL
from tests.toyset import write_toys

TIMES = int(os.environ.get("CSM_SOAK", "1"))
OPTIONS = [*SMALL, "data.root=toys", "trainer.max_epochs=40", "trainer.check_val_every_n_epoch=5"]
ROW = "+rows.toy=[" + ",".join(f"'{option}'" for option in OPTIONS) + "]"


class Bench:
    """A folder with toys in which commands run and are killed."""

    def __init__(self, folder: Path, seed: int) -> None:
        self.folder, self.random = folder, random.Random(seed)
        write_toys(folder / "toys")

    def start(self, command: str, *arguments: str) -> subprocess.Popen[bytes]:
        environment = {**os.environ, "CSM_CACHE": str(self.folder / "store")}
        line = [sys.executable, "-m", f"csm.commands.{command}", *arguments]
        with (self.folder / "log.txt").open("a") as log:
            return subprocess.Popen(line, cwd=self.folder, env=environment, stdout=log, stderr=log)

    def run(self, command: str, *arguments: str) -> float:
        """Run to the end; return the seconds."""
        begun = time.monotonic()
        assert self.start(command, *arguments).wait(900) == 0, (self.folder / "log.txt").read_text()[-3000:]
        return time.monotonic() - begun

    def kill(self, times: int, seconds: float, command: str, *arguments: str) -> None:
        """Start a command, stop it after a while by SIGKILL or SIGTERM, and start it again."""
        for _ in range(times):
            process = self.start(command, *arguments)
            time.sleep(self.random.uniform(0.2, 1) * seconds)
            process.send_signal(self.random.choice([signal.SIGKILL, signal.SIGTERM]))
            process.wait(60)


@pytest.mark.parametrize("seed", range(TIMES))
def test_a_matrix_that_is_killed_gives_the_table_of_one_that_is_not(tmp_path, seed):
    bench = Bench(tmp_path, seed)
    seconds = bench.run("matrix", "folder=alone", "seeds=[0,1]", ROW)
    bench.kill(8, seconds, "matrix", "folder=killed", "seeds=[0,1]", ROW)
    bench.run("matrix", "folder=killed", "seeds=[0,1]", ROW)
    tables = [
        [(r.method, r.test, r.matching, r.seeds, r.epochs, r.age, r.exact_match) for r in read_rows(path)]
        for path in (tmp_path / "alone/matrix.json", tmp_path / "killed/matrix.json")
    ]
    assert tables[0] == tables[1]


@pytest.mark.parametrize("seed", range(TIMES))
def test_a_sweep_that_is_killed_gives_the_numbers_of_one_that_is_not(tmp_path, seed):
    bench = Bench(tmp_path, seed)
    jobs = ["-m", *OPTIONS, "seed=0,1"]
    seconds = bench.run("train", *jobs, "hydra.sweep.dir=alone")
    bench.kill(3, seconds, "train", *jobs, "hydra.sweep.dir=killed")
    bench.run("train", *jobs, "hydra.sweep.dir=killed")
    tables = []
    for name in ("alone", "killed"):
        with (tmp_path / name / "sweep.csv").open() as file:
            tables.append([(line["seed"], line["age/toys"]) for line in csv.DictReader(file)])
    assert tables[0] == tables[1]
