from __future__ import annotations

import pytest

from csm.descriptors import preset
from csm.errors import ConfigError
from csm.studies import timing
from csm.studies.timing import Timed, time_descriptor
from tests.shapes import blob


def test_the_median_counts_and_the_share_tells_a_busy_machine():
    timed = Timed((1.0, 9.0, 2.0), (1.0, 3.0, 1.0))
    assert timed.seconds == 2.0
    assert timed.share == 0.5


def test_a_descriptor_is_timed_in_another_process_as_often_as_asked():
    descriptor = preset("acd_paper", angles=2)
    timed = time_descriptor(blob(3), {"name": "acd", **descriptor.parameters()}, threads=1, repeats=2)
    assert len(timed.wall) == len(timed.cpu) == 2
    assert 0.001 < timed.seconds < 60


def test_every_repeat_is_cold_and_keeps_to_its_threads(monkeypatch):
    asked, solved = [], []
    honest = timing.Operators
    monkeypatch.setattr(timing, "threadpool_limits", lambda n: asked.append(n) or _Nothing())
    monkeypatch.setattr(timing, "Operators", lambda mesh: solved.append(mesh) or honest(mesh))
    mesh = blob(2)
    parameters = {"name": "hks", **preset("hks", k=20).parameters()}
    timing._timed(mesh.vertices, mesh.faces, parameters, threads=2, repeats=3)
    assert asked == [2]
    assert len({id(m) for m in solved}) == 4  # one of them to warm up


def test_wrong_parameters_are_refused_in_the_caller_too():
    with pytest.raises(ConfigError, match="nothing"):
        timing._timed(blob(1).vertices, blob(1).faces, {"name": "nothing"}, 1, 1)


class _Nothing:
    def __enter__(self):
        return self

    def __exit__(self, *_):
        return None
