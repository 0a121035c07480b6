"""Locks between processes; each other process is a fresh Python, as another command would be."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import time

import pytest

from csm._locks import locked
from csm.errors import ConfigError

HOLD = """
import sys, time
from csm._locks import locked
with locked(sys.argv[1]):
    print("held", flush=True)
    time.sleep(float(sys.argv[2]))
"""


@pytest.fixture
def holding():
    """Start a process that holds a lock for some seconds; it is ended with the test."""
    started = []

    def hold(path, seconds=60.0) -> subprocess.Popen:
        process = subprocess.Popen([sys.executable, "-c", HOLD, str(path), str(seconds)], stdout=subprocess.PIPE)
        started.append(process)
        assert process.stdout.readline() == b"held\n"
        return process

    yield hold
    for process in started:
        process.kill()
        process.wait()
        process.stdout.close()


def test_a_folder_in_which_another_works_is_refused_at_once(tmp_path, holding):
    holding(tmp_path)
    begun = time.monotonic()
    with pytest.raises(ConfigError, match=r"another run of csm is working in this folder.*choose another") as caught:
        locked(tmp_path, wait=0).__enter__()
    assert time.monotonic() - begun < 1
    assert str(tmp_path) in str(caught.value)
    assert str(caught.value).count("\n") == 0


def test_a_file_is_waited_for(tmp_path, holding):
    holding(tmp_path / "rows.json", 1.0)
    begun = time.monotonic()
    with locked(tmp_path / "rows.json", wait=30):
        assert time.monotonic() - begun > 0.3


def test_waiting_has_an_end(tmp_path, holding):
    holding(tmp_path / "rows.json")
    with pytest.raises(ConfigError, match=r"rows\.json: another run of csm has kept this file locked for 0\.2 s"):
        locked(tmp_path / "rows.json", wait=0.2).__enter__()


def test_two_names_of_one_file_have_one_lock(tmp_path, holding):
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "real")
    holding(tmp_path / "real" / "a.json")
    with pytest.raises(ConfigError, match="locked"):
        locked(tmp_path / "link" / "a.json", wait=0).__enter__()


@pytest.mark.skipif(sys.platform == "win32", reason="there is no SIGKILL")
def test_a_kill_gives_the_lock_up_and_what_it_leaves_is_harmless(tmp_path, holding):
    process = holding(tmp_path)
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert [path.name for path in tmp_path.iterdir()] == [".csm.lock"]
    with locked(tmp_path, wait=0):
        pass


def test_other_files_are_free_and_the_lock_ends_with_the_block(tmp_path):
    with locked(tmp_path / "a.json"), locked(tmp_path / "b.json", wait=0), locked(tmp_path, wait=0):
        pass
    with locked(tmp_path / "a.json", wait=0):
        pass
    with pytest.raises(ZeroDivisionError), locked(tmp_path / "a.json", wait=0):
        _ = 1 / 0
    with locked(tmp_path / "a.json", wait=0):
        pass
    assert all(path.name.startswith(".") and path.stat().st_size == 0 for path in tmp_path.iterdir())


def test_a_file_system_that_cannot_lock_is_a_warning(tmp_path, monkeypatch, caplog):
    fcntl = pytest.importorskip("fcntl")

    def refuse(*_):
        raise OSError(errno.ENOSYS, "Function not implemented")

    monkeypatch.setattr(fcntl, "flock", refuse)
    with locked(tmp_path / "a.json"):
        pass
    assert "a.json: cannot be locked here (Function not implemented)" in caplog.text


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="nothing is read-only for this user")
def test_a_read_only_folder_is_a_warning(tmp_path, caplog):
    tmp_path.chmod(0o500)
    with locked(tmp_path, wait=0):
        pass
    tmp_path.chmod(0o700)
    assert "cannot be locked" in caplog.text
