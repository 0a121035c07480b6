from __future__ import annotations

import shlex

import pytest

from csm.commands.words import to_overrides
from csm.data.bodies import archive
from csm.data.bodies.archive import Bodies
from csm.data.humans import load_humans


@pytest.fixture
def humans_instead(monkeypatch):
    """The built-in humans in place of what the body model makes, which takes long to start."""
    monkeypatch.setattr(archive, "_made", lambda seed, number: load_humans()[10 * seed + number].vertices)
    monkeypatch.setattr("csm.data.bodies.making.require_anny", lambda: None)
    monkeypatch.setattr("csm.data.bodies.making.versions", lambda: ["anny 0"])


def test_bodies_are_written_and_what_is_there_is_left(csm, tmp_path, humans_instead):
    status, out, _ = csm("bodies", "few.npz", "count=2", "seed=1", "workers=0")
    assert status == 0
    assert "2 bodies of 6899 vertices: few.npz" in out
    assert "'data.also=[few.npz]'" in out
    found = Bodies(tmp_path / "few.npz").load("b00001").mesh.vertices
    assert abs(found - load_humans()[11].vertices).max() < 1e-4
    before = (tmp_path / "few.npz").read_bytes()
    status, _, error = csm("bodies", "few.npz", "count=3", "workers=0")
    assert status == 2
    assert "few.npz: is there already; overwrite=true replaces it" in error
    assert (tmp_path / "few.npz").read_bytes() == before
    assert csm("bodies", "few.npz", "count=3", "workers=0", "overwrite=true")[0] == 0
    assert len(Bodies(tmp_path / "few.npz").names) == 3


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((), "bodies need a place"),
        (("a.txt",), "ends with .npz"),
        (("a.npz", "count=0"), "count=0: wanted a whole number from 1"),
        (("a.npz", "count=abc"), "count=abc: wanted a whole number from 1"),
    ],
)
def test_what_cannot_work_is_said_at_once(csm, words, said):
    status, _, error = csm("bodies", *words)
    assert status == 2
    assert said in error


def test_the_line_that_trains_on_them_can_be_pasted(csm, humans_instead):
    out = csm("bodies", "a b=c.npz", "count=1", "workers=0")[1]
    words = shlex.split(out.split("csm train ")[1])
    assert to_overrides("train", words) == ["experiment=humans", "data.also=['a b=c.npz']"]
