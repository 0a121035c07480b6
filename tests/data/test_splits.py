from __future__ import annotations

import json

import pytest

from csm.data.registry import DATA_SETS, data_set
from csm.data.splits import Split, as_split, read_split
from csm.errors import DataError

CHECKSUMS = {
    "faust_80_20": "8f0cebb95e75",
    "faust_held_out": "0f2adee1ea45",
    "humans_80_20": "fc95d86ef489",
    "humans_demo": "c94125a1c470",
    "scape_51_20": "59b854fde6c0",
}
"""Of the splits that results were published with; they never change."""

TINY = Split("tiny", ("x", "y"), ("z",), "made up")


def test_the_splits_of_csm_are_those_that_results_were_published_with():
    splits = [split for name in DATA_SETS for split in data_set(name).splits]
    assert {split.name: split.checksum for split in splits} == CHECKSUMS
    assert all(split.source for split in splits)
    every = [[*s.train, *s.test, *s.validation] for s in splits]
    assert all(len(set(names)) == len(names) for names in every)


def test_the_checksum_depends_on_order_and_names():
    sums = {Split("a", *lists).checksum for lists in ((("x", "y"), ("z",)), (("y", "x"), ("z",)), (("x",), ("y", "z")))}
    assert len(sums) == 3
    assert Split("other name", TINY.train, TINY.test).checksum == TINY.checksum


def test_a_label_names_sizes_and_checksum():
    assert TINY.label == f"tiny (2 train, 1 test, {TINY.checksum})"


def test_a_split_is_read_from_json(tmp_path):
    content = {"name": "tiny", "train": ["x", "y"], "test": ["z"], "source": "made up", "checksum": TINY.checksum}
    (tmp_path / "s.json").write_text(json.dumps(content))
    assert read_split(tmp_path / "s.json") == TINY


def test_a_split_may_have_validation_shapes_that_leave_its_checksum_as_it_is(tmp_path):
    content = {"name": "tiny", "train": ["x", "y"], "test": ["z"], "validation": ["v"], "checksum": TINY.checksum}
    (tmp_path / "s.json").write_text(json.dumps(content))
    assert read_split(tmp_path / "s.json").validation == ("v",)
    (tmp_path / "s.json").write_text(json.dumps(content | {"validation": ["z"]}))
    with pytest.raises(DataError, match="more than once: z"):
        read_split(tmp_path / "s.json")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{", "not a split file"),
        ("[" * 100_000, "not a split file"),
        ("[1]", "not a split file"),
        ('{"name": "a", "train": "xyz", "test": ["w"]}', "not lists of names"),
        ('{"name": "a", "train": [1, 2], "test": ["w"]}', "not lists of names"),
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


def test_a_split_is_given_by_itself_its_name_or_a_file(tmp_path):
    other = Split("other", ("x",), ("z",))
    assert as_split(TINY) is TINY
    assert as_split("tiny", [other, TINY]) is TINY
    path = tmp_path / "s.json"
    path.write_text('{"name": "other", "train": ["x"], "test": ["z"]}')
    assert as_split(path, [TINY]) == as_split(str(path)) == other
    with pytest.raises(DataError, match=r"split=tinny: .*wanted other or tiny, or the path of a json file"):
        as_split("tinny", [other, TINY])
    with pytest.raises(DataError, match=r"split=nowhere\.json: .*wanted the path of a json file"):
        as_split("nowhere.json")


def test_holding_out_everything_is_an_error():
    assert TINY.held_out(1) == (("x",), ("y",))
    assert TINY.held_out(0) == (("x", "y"), ())
    with pytest.raises(DataError, match="cannot hold out 2 of 2"):
        TINY.held_out(2)


def test_shapes_that_a_set_lacks_are_named():
    TINY.require(["z", "y", "x"], "set", "train")
    with pytest.raises(DataError, match=r"set: 1 of the 2 train shapes of split tiny are missing \(y\)"):
        TINY.require(["x", "z"], "set", "train")
