"""What csm replaces: its own files that are as it left them, and nothing else."""

from __future__ import annotations

import json
import os

import pytest

from csm.errors import DataError
from csm.mesh.io import file_digest
from csm.mesh.io.owned import files_of, put_in_place, remove_left, require_not_input, require_own


def test_an_input_is_never_an_output_by_whatever_name(tmp_path):
    mesh, link, hard = tmp_path / "a.ply", tmp_path / "link.ply", tmp_path / "hard.ply"
    mesh.write_text("ply")
    link.symlink_to(mesh)
    hard.hardlink_to(mesh)
    for other in (mesh, link, hard, tmp_path / "x" / ".." / "a.ply"):
        (tmp_path / "x").mkdir(exist_ok=True)
        with pytest.raises(DataError, match="would be replaced"):
            require_not_input([other], [mesh])
    require_not_input([tmp_path / "b.ply"], [mesh])


def test_what_csm_wrote_may_be_replaced_and_nothing_else(tmp_path):
    account, path = tmp_path / "match.json", tmp_path / "map.txt"
    require_own([path], account, False)
    path.write_text("mine")
    said = r"map\.txt: there is such a file, which was not written by csm.*overwrite=True"
    with pytest.raises(DataError, match=said):
        require_own([path], account, False)
    require_own([path], account, True)
    account.write_text(json.dumps({"files": {"map.txt": file_digest(path)}}))
    require_own([path], account, False)
    path.write_text("edited")
    with pytest.raises(DataError, match="has been changed since csm wrote it"):
        require_own([path], account, False)


@pytest.mark.parametrize("content", ["[]", "{}", "no json", '{"files": 3}'])
def test_a_json_of_somebody_else_is_not_replaced(tmp_path, content):
    (tmp_path / "match.json").write_text(content)
    with pytest.raises(DataError, match=r"match\.json"):
        require_own([tmp_path / "map.txt"], tmp_path / "match.json", False)


@pytest.mark.parametrize(("one", "other"), [("match.json", "collection.json"), ("collection.json", "match.json")])
def test_a_folder_has_one_kind_of_match(tmp_path, one, other):
    (tmp_path / one).write_text('{"files": {}}')
    require_own([], tmp_path / other)
    (tmp_path / one).write_text('{"files": {"map.txt": "0123"}}')
    with pytest.raises(DataError, match=rf"{one}.*overwrite=True to have both in it"):
        require_own([], tmp_path / other)
    require_own([], tmp_path / other, overwrite=True)
    require_own([], tmp_path / one)
    require_own([], tmp_path / "a.clean.json")


def test_what_is_no_file_is_not_replaced(tmp_path):
    os.mkfifo(tmp_path / "map.txt")
    with pytest.raises(DataError, match=r"map\.txt"):
        require_own([tmp_path / "map.txt"], tmp_path / "match.json", False)


def test_the_place_of_the_question_says_what_can_be_done(tmp_path):
    (tmp_path / "map.txt").write_text("mine")
    with pytest.raises(DataError, match=r"here; give another out=$"):
        require_own([tmp_path / "map.txt"], tmp_path / "match.json", remedy="give another out=")


def test_an_account_is_there_before_the_files_that_it_tells_of(tmp_path, monkeypatch):
    staged, out = tmp_path / "staged", tmp_path / "out"
    (staged / "maps").mkdir(parents=True)
    for name in ("maps/a.txt", "b.txt"):
        (staged / name).write_text(name)

    def full(source, target):
        raise OSError(28, "No space left on device", str(target))

    with monkeypatch.context() as broken:
        broken.setattr("csm.mesh.io.owned.copy_file", full)
        with pytest.raises(OSError, match="No space"):
            put_in_place(staged, ["maps/a.txt", "b.txt"], out / "all.json", {"who": "me"})
    assert json.loads((out / "all.json").read_text())["who"] == "me"
    put_in_place(staged, ["maps/a.txt", "b.txt"], out / "all.json", {})
    assert (out / "maps/a.txt").read_text() == "maps/a.txt"
    assert files_of(out / "all.json") == {n: file_digest(staged / n) for n in ("maps/a.txt", "b.txt")}
    require_own([out / "b.txt"], out / "all.json")


def test_of_an_earlier_run_only_what_is_as_it_was_left_is_removed(tmp_path):
    for name in ("old.txt", "changed.txt", "elsewhere.txt"):
        (tmp_path / name).write_text("csm")
    (tmp_path / "link.txt").symlink_to(tmp_path / "elsewhere.txt")
    known = dict.fromkeys(["old.txt", "changed.txt", "link.txt", "gone.txt"], file_digest(tmp_path / "old.txt"))
    (tmp_path / "changed.txt").write_text("mine")
    remove_left(tmp_path / "all.json", known)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["changed.txt", "elsewhere.txt", "link.txt"]
