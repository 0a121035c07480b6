"""The store from the command line: filled, checked and pruned; `test_pipeline.py` has it within a whole experiment."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time

import pytest
from omegaconf import OmegaConf

from csm.commands.prepare import all_jobs, check_store, fill_store, prune_store, run, shard_of
from csm.data.additional import Additional
from csm.data.shapes import InMemory
from csm.data.store import Store
from csm.errors import ConfigError, DataError
from tests.shapes import sphere
from tests.toyset import toy_datamodule, write_toys


def test_the_store_is_filled_checked_and_pruned(tmp_path, capsys):
    data = toy_datamodule(tmp_path)
    assert len(all_jobs(data)) == 6
    assert fill_store(data, all_jobs(data), 0).made == 6
    assert fill_store(data, all_jobs(data), 0).present == 6
    assert check_store(data.store)["entries"] == 12
    broken = data.store.files()[0]
    broken.write_bytes(b"cut")
    with pytest.raises(DataError, match=rf"1 faulty files in .*action=prune(.|\n)*{broken.name}"):
        check_store(data.store)
    assert prune_store(data.store, None) == {"deleted": 1}
    assert str(broken) in capsys.readouterr().out
    assert check_store(data.store)["entries"] == 11


@pytest.mark.parametrize("shards", [1, 2, 3, 5, 9])
def test_the_parts_of_a_preparation_have_nothing_in_common_and_leave_nothing_out(tmp_path, shards):
    data = toy_datamodule(tmp_path)
    jobs = all_jobs(data)
    parts = [shard_of(jobs, shard, shards) for shard in range(shards)]
    assert sorted(job.label for part in parts for job in part) == sorted(job.label for job in jobs)
    assert max(map(len, parts)) - min(map(len, parts)) <= 1
    with pytest.raises(ConfigError, match=rf"shard={shards}: "):
        shard_of(jobs, shards, shards)


def test_parts_are_made_by_a_sweep_over_one_store_and_skipped_when_they_are_there(csm, tmp_path):
    write_toys(tmp_path / "toys")
    small = "data=folder data.root=toys data.n_test=2 data.basis_k=24 descriptor.angles=3 descriptor.k=8 model=mlp"
    words = [*small.split(), "workers=0", "shards=4", "shard=range(4)", "store=s"]
    status, said, _ = csm("prepare", "-m", *words)
    assert status == 0
    assert re.findall(r"(\d) made, (\d) already there", said) == [("2", "0"), ("2", "0"), ("1", "0"), ("1", "0")]
    (lost := Store(tmp_path / "s").files()[0]).unlink()
    _, said, _ = csm("prepare", "-m", *words)
    assert sorted(re.findall(r"(\d) made", said)) == ["0", "0", "0", "1"]
    assert lost.exists()


def test_additional_shapes_are_prepared_too(tmp_path):
    data = toy_datamodule(tmp_path)
    data.also = (Additional(InMemory([data.test_sets["toys"].load("toy5")], "more"), ("toy5",)),)
    assert "more/toy5" in [job.label for job in all_jobs(data)]


def test_a_store_that_cannot_be_written_is_refused_before_the_work(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("mine")
    data = toy_datamodule(tmp_path, store=Store(tmp_path / "file"))
    monkeypatch.setattr("csm.commands.prepare.prepare", None)
    with pytest.raises(DataError, match=r"file: the store cannot be written .*CSM_CACHE"):
        fill_store(data, all_jobs(data), 0)


@pytest.mark.parametrize("days", ["abc", -1, True, float("nan"), float("inf")])
def test_days_that_are_no_number_are_refused(tmp_path, days):
    store = Store(tmp_path / "store")
    store.fetch("lbo", sphere(1), {}, lambda: {"a": sphere(1).vertices})
    with pytest.raises(ConfigError, match="unused_days="):
        run(OmegaConf.create({"action": "prune", "store": str(store.root), "unused_days": days}))
    assert len(store.files()) == 1


FILL = """
import sys
from csm._signals import exit_status, terminable
from csm.data.prepare import Job, Recipe, prepare
from csm.data.registry import recognise
from csm.data.store import Store
from csm.descriptors import ACD

if __name__ == "__main__":
    shapes = recognise(sys.argv[1])
    try:
        with terminable():
            jobs = [Job(shapes, name) for name in shapes.names]
            prepare(jobs, [Recipe(ACD(angles=8, k=60), 60)], Store(sys.argv[2]), workers=2)
    except KeyboardInterrupt as stop:
        print(f"stopped: {stop}", file=sys.stderr)
        sys.exit(exit_status(stop))
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals of Unix")
@pytest.mark.parametrize(("sent", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_stop_says_in_two_seconds_what_is_kept(tmp_path, sent, status):
    """Sent to all processes, as a terminal and a scheduler do; what is said to be kept is there."""
    write_toys(tmp_path / "toys", 40, 3)
    store = Store(tmp_path / "store")
    ran = subprocess.Popen(
        [sys.executable, "-c", FILL, str(tmp_path / "toys"), str(store.root)],
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    end = time.monotonic() + 60
    while len(store.files()) < 3 and time.monotonic() < end:
        time.sleep(0.05)
    begun = time.monotonic()
    os.killpg(ran.pid, sent)
    said = ran.communicate(timeout=30)[1]
    assert time.monotonic() - begun < 2
    assert ran.returncode == status
    assert "Traceback" not in said
    (line,) = [line for line in said.splitlines() if line.startswith("stopped: ")]
    kept = int(line.removeprefix("stopped: ").partition(" of 40 shapes are in the store; run the same command")[0])
    sound, faults = store.check()
    assert faults == []
    assert kept <= sum(entry.kind == "descriptor" for entry in sound) < 40
    assert not list(store.root.rglob(".*"))
