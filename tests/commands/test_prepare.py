"""The store from the command line: filled, checked and pruned; `test_pipeline.py` has it within a whole experiment."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import pytest
from omegaconf import OmegaConf

from csm.commands.prepare import all_jobs, check_store, fill_store, prune_store, run
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
