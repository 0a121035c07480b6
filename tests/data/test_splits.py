from __future__ import annotations

import json

import pytest

from csm.data.splits import Split, read_split
from csm.errors import DataError
from tests.conftest import ROOT


@pytest.mark.parametrize("path", sorted((ROOT / "conf/split").glob("*.json")), ids=lambda p: p.stem)
def test_shipped_splits_are_sound_and_state_their_checksum(path):
    split = read_split(path)
    assert split.name == path.stem
    assert split.source
    assert json.loads(path.read_text())["checksum"] == split.checksum


def test_the_papers_splits():
    faust, scape = (read_split(ROOT / f"conf/split/{n}.json") for n in ("faust_80_20", "scape_51_20"))
    assert (faust.train[0], faust.train[-1], faust.test[0], faust.test[-1]) == (
        "tr_reg_000",
        "tr_reg_079",
        "tr_reg_080",
        "tr_reg_099",
    )
    assert (len(scape.train), len(scape.test)) == (51, 20)
    assert "mesh051" not in scape.train + scape.test


def test_the_checksum_depends_on_order_and_names():
    sums = {Split("a", *lists).checksum for lists in ((("x", "y"), ("z",)), (("y", "x"), ("z",)), (("x",), ("y", "z")))}
    assert len(sums) == 3


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{", "not a split file"),
        ('{"name": "a", "train": ["x"]}', "not a split file"),
        ('{"name": "a", "train": ["x"], "test": ["x"]}', "more than once: x"),
        ('{"name": "a", "train": ["x"], "test": ["y"], "checksum": "0"}', "it was edited"),
    ],
)
def test_bad_files_are_named(tmp_path, content, message):
    (tmp_path / "s.json").write_text(content)
    with pytest.raises(DataError, match=message) as caught:
        read_split(tmp_path / "s.json")
    assert "s.json" in str(caught.value)


def test_holding_out_everything_is_an_error():
    split = Split("a", ("x", "y"), ("z",))
    assert split.held_out(1) == (("x",), ("y",))
    assert split.held_out(0) == (("x", "y"), ())
    with pytest.raises(DataError, match="cannot hold out 2 of 2"):
        split.held_out(2)
