"""Bars in terminals, lines in logs."""

from __future__ import annotations

import io
import sys
from types import SimpleNamespace

import pytest

from csm import _progress
from csm._progress import Lines, progress_bar


class Stream(io.StringIO):
    """Text in memory that says whether it is a terminal."""

    def __init__(self, terminal: bool) -> None:
        super().__init__()
        self.terminal = terminal

    def isatty(self) -> bool:
        return self.terminal


@pytest.fixture
def clock(monkeypatch):
    """A clock of lines that stands still until it is moved."""
    now = [0.0]
    monkeypatch.setattr(_progress, "time", SimpleNamespace(monotonic=lambda: now[0]))
    return now


def run(monkeypatch, terminal: bool, clock: list[float], seconds: float) -> str:
    stream = Stream(terminal)
    monkeypatch.setattr(sys, "stderr", stream)
    with progress_bar(total=100, desc="work", unit="shape") as bar, progress_bar(range(3), leave=False) as inner:
        assert list(inner) == [0, 1, 2]
        for k in range(100):
            clock[0] += seconds
            bar.set_postfix_str(f"shape{k}")
            bar.update()
    return stream.getvalue()


def test_a_log_gets_whole_lines_a_minute_apart(monkeypatch, clock):
    said = run(monkeypatch, False, clock, 1.5)
    lines = said.splitlines()
    assert 2 <= len(lines) <= 3
    assert all(line.startswith("work: ") and "shape" in line for line in lines)
    assert not {"\r", "\x1b"} & set(said)


def test_the_first_lines_come_soon_and_the_others_a_minute_apart(clock):
    stream, times = Stream(False), []
    lines = Lines(stream, _progress.FIRST, _progress.SECONDS)
    while clock[0] < 300:
        clock[0] += 1
        before = stream.tell()
        lines.write(f"work: {clock[0]:.0f} s")
        times += [clock[0]] * (stream.tell() > before)
    assert times == [15, 45, 105, 165, 225, 285]


def test_a_log_of_a_short_run_stays_empty(monkeypatch, clock):
    assert run(monkeypatch, False, clock, 0.1) == ""


def test_a_terminal_gets_a_bar_that_is_redrawn_with_the_names(monkeypatch, clock):
    said = run(monkeypatch, True, clock, 0.0)
    assert said.count("\r") >= 100
    assert all(f"shape{k}" in said for k in range(100))
