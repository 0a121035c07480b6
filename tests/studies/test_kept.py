from __future__ import annotations

import json

import pytest

from csm.studies.kept import kept, this_machine


def test_an_answer_is_made_once_and_again_for_another_question(tmp_path, caplog):
    path, made = tmp_path / "new" / "a.json", []

    def make():
        made.append(1)
        return {"seconds": (1.5, 2.0)}

    first = kept(path, {"sizes": (3, 4)}, make)
    assert first == {"seconds": [1.5, 2.0]} == kept(path, {"sizes": [3, 4]}, make)
    assert len(made) == 1
    kept(path, {"sizes": [3, 5]}, make)
    assert len(made) == 2
    assert "another question" in caplog.text
    assert json.loads(path.read_text())["question"] == {"sizes": [3, 5]}


def test_what_fails_leaves_the_old_answer(tmp_path):
    path = tmp_path / "a.json"
    kept(path, {"a": 1}, lambda: {"b": 2})

    def fail():
        raise RuntimeError("no")

    with pytest.raises(RuntimeError):
        kept(path, {"a": 2}, fail)
    assert kept(path, {"a": 1}, fail) == {"b": 2}


def test_the_machine_says_how_many_processors():
    assert "processors" in this_machine()
