"""A store under kills, removals, damage and full disks, and a results file under kills, for some minutes each.

The names of these files keep them out of the ordinary tests; tests/test_stress.py has short versions.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import random
import resource
import time

import numpy as np
import pytest

from csm.data.store import Store
from csm.evaluation.report import add_rows, read_rows
from tests.evaluation.test_report import row
from tests.shapes import sphere
from tests.stress import Filling

TIMES = int(os.environ.get("CSM_SOAK", "1"))

fork = multiprocessing.get_context("fork")


@pytest.mark.parametrize("seed", range(TIMES))
def test_kills_leave_what_one_undisturbed_process_makes(tmp_path, seed):
    filling = Filling(tmp_path, 12, seed)
    filling.kill(18, processes=3)
    filling.assert_equal_to_undisturbed()
    old = time.time() - 7200
    for path in filling.store.root.rglob(".*.npz"):
        os.utime(path, (old, old))
    filling.store.prune()
    assert not list(filling.store.root.rglob(".*.npz"))
    filling.assert_equal_to_undisturbed()


@pytest.mark.parametrize("seed", range(TIMES))
@pytest.mark.parametrize("harm", ["remove", "damage"])
def test_harm_during_a_run_is_mended(tmp_path, harm, seed):
    filling = Filling(tmp_path, 12, seed)
    for _ in range(5):
        filling.disturb(getattr(filling, harm), every=0.1)
    filling.run()
    filling.read_all()
    filling.assert_equal_to_undisturbed()


def _fetch_on_a_small_disk(root: str, seed: int) -> None:
    choose = random.Random(seed)
    store = Store(root)
    for _ in range(200):
        limit = choose.randrange(100, 40_000)
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))
        n, k = choose.randrange(1, 4000), choose.randrange(50)
        found = store.fetch("lbo", sphere(1), {"k": k, "n": n}, lambda n=n, k=k: {"a": np.full(n, float(k))})
        assert found["a"].tolist() == [k] * n


@pytest.mark.parametrize("seed", range(TIMES))
def test_a_disk_that_is_full_now_and_then_leaves_whole_entries_only(tmp_path, seed):
    workers = [fork.Process(target=_fetch_on_a_small_disk, args=(str(tmp_path), 10 * seed + i)) for i in range(3)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join(600)
    assert [worker.exitcode for worker in workers] == [0] * 3
    sound, faults = Store(tmp_path).check()
    assert faults == []
    assert len(sound) > 50
    assert not list(tmp_path.rglob(".*.npz"))


@pytest.mark.parametrize("ahead", [86400.0 * 400, -86400.0 * 400])
def test_clocks_that_are_wrong_lose_nothing_that_is_in_use(tmp_path, ahead):
    filling = Filling(tmp_path, 6, 0)
    filling.run()
    now = time.time()
    for path in filling.store.files():
        os.utime(path, (now + ahead, now + ahead))
    filling.store.prune()
    filling.assert_equal_to_undisturbed()
    filling.store.prune(unused_days=3000)
    filling.assert_equal_to_undisturbed()


def _add(path: str, name: str, done: str) -> None:
    for i in range(100):
        add_rows(path, [row(method=f"{name} {i}")])
        with open(done, "a") as file:
            file.write(f"{name} {i}\n")


@pytest.mark.parametrize("seed", range(TIMES))
def test_rows_are_kept_though_processes_that_add_some_are_killed(tmp_path, seed):
    choose, path = random.Random(seed), str(tmp_path / "r.json")
    adding = [fork.Process(target=_add, args=(path, name, str(tmp_path / f"{name}.done"))) for name in "abcdef"]
    for process in adding:
        process.start()
    for victim in adding[:3]:
        time.sleep(choose.uniform(0.2, 1.5))
        victim.kill()
    for process in adding:
        process.join(600)
    assert [process.exitcode for process in adding] == [-9] * 3 + [0] * 3
    wanted = {line for done in tmp_path.glob("*.done") for line in done.read_text().splitlines()}
    found = {r.method for r in read_rows(path)}
    assert wanted <= found
    assert len(wanted) >= 300
    assert len(json.loads((tmp_path / "r.json").read_text())) == len(found) <= len(wanted) + 3
