"""What workers do when things end badly: a death, a stop, a parent that is killed."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from csm._parallel import parallel_map
from csm.errors import ConfigError

ROOT = Path(__file__).resolve().parent.parent

unix = pytest.mark.skipif(sys.platform == "win32", reason="signals of Unix")

MAIN = """
import sys
from tests import test_workers
if __name__ == "__main__":
    test_workers.main(sys.argv[1])
"""


def slow(folder: str) -> None:
    """Leave a file with the number of the process, then work for long."""
    with open(os.path.join(folder, str(os.getpid())), "x"):
        time.sleep(120)


def main(folder: str) -> None:
    """Run in a process that is stopped from outside: two workers that work for long."""
    from csm._signals import exit_status, saying, terminable

    try:
        with terminable(), saying(lambda: "nothing is kept"):
            parallel_map(slow, [folder] * 2, str, 2, what="sleep", unit="task", progress=False)
    except KeyboardInterrupt as stop:
        print(f"stopped: {stop}", file=sys.stderr)
        sys.exit(exit_status(stop))


def fail(how: str) -> str:
    if how == "die":
        os.kill(os.getpid(), signal.SIGKILL)
    if how == "leave":
        os._exit(3)
    if how == "unpicklable":
        raise Odd("a", "b")
    return how


def process(_: int) -> int:
    return os.getpid()


class Odd(Exception):  # noqa: N818
    """An error that cannot be unpickled: it forgets its second argument."""

    def __init__(self, one: str, two: str) -> None:
        super().__init__(one)


def mapped(*tasks: str) -> list[str]:
    return parallel_map(fail, tasks, lambda task: f"task {task}", 2, what="fail", unit="task", progress=False)


def alive(process: int) -> bool:
    try:
        with open(f"/proc/{process}/stat") as file:
            return file.read().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def gone_within(seconds: float, processes: list[int]) -> bool:
    end = time.monotonic() + seconds
    while time.monotonic() < end and any(map(alive, processes)):
        time.sleep(0.05)
    return not any(map(alive, processes))


@unix
def test_a_worker_that_is_killed_is_one_sentence_with_its_task():
    with pytest.raises(ConfigError, match=r"^task die: .*signal 9.*memory.*fewer workers") as caught:
        mapped("a", "die", "b", "c")
    assert "\n" not in str(caught.value)


def test_a_worker_that_leaves_is_told_from_one_that_is_killed():
    with pytest.raises(ConfigError, match=r"^task leave: .*status 3"):
        mapped("a", "leave", "b")


@pytest.mark.parametrize("task", ["leave", pytest.param("die", marks=unix)])
def test_what_is_advised_after_a_death_does_without_processes(task):
    with pytest.raises(ConfigError) as caught:
        mapped("a", task, "b")
    (advised,) = re.findall(r"workers=(\d)", str(caught.value))
    assert f"workers={advised}" in (ROOT / "docs/python.md").read_text()
    here = os.getpid()
    assert set(parallel_map(process, [1, 2, 3], str, int(advised), what="", unit="", progress=False)) == {here}


class Last:
    """An object that is told to end while it is deleted, where Python drops the SystemExit."""

    def __del__(self) -> None:
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(0.05)


def delete_one(_: int) -> None:
    Last()
    time.sleep(20)


@unix
def test_a_stop_that_comes_while_an_object_is_deleted_is_obeyed_in_silence(capfd):
    begun = time.monotonic()
    with pytest.raises(ConfigError, match="status 143"):
        parallel_map(delete_one, [0, 1], str, 2, what="delete", unit="task", progress=False)
    assert time.monotonic() - begun < 15
    assert capfd.readouterr().err == ""


def test_an_error_that_cannot_travel_is_told_by_its_text():
    with pytest.raises(RuntimeError, match="Odd: a"):
        mapped("a", "unpicklable")


@pytest.fixture
def running(tmp_path):
    """Start a process with two workers at work, in a group of its own as in a terminal; give it and its workers."""
    process = subprocess.Popen(
        [sys.executable, "-c", MAIN, str(tmp_path)], stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    end = time.monotonic() + 60
    while len(list(tmp_path.iterdir())) < 2 and time.monotonic() < end:
        time.sleep(0.05)
    yield process, [int(path.name) for path in tmp_path.iterdir()]
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    process.stderr.close()


@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
@pytest.mark.parametrize(
    ("sent", "to_all", "status"),
    [
        (signal.SIGINT, True, 130),
        (signal.SIGTERM, True, 143),
        (signal.SIGINT, False, 130),
        (signal.SIGTERM, False, 143),
    ],
)
def test_a_stop_takes_two_seconds_and_says_one_line(running, sent, status, to_all):
    process, workers = running
    assert len(workers) == 2
    begun = time.monotonic()
    (os.killpg if to_all else os.kill)(process.pid, sent)
    said = process.communicate(timeout=30)[1]
    assert time.monotonic() - begun < 2
    assert (process.returncode, said) == (status, "stopped: nothing is kept\n")
    assert gone_within(0.5, workers)


@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
def test_workers_end_with_a_parent_that_is_killed(running):
    process, workers = running
    assert all(map(alive, workers))
    process.kill()
    assert gone_within(2, workers)
