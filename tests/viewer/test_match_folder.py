"""What a match leaves in a folder: its files and account, and a page that shows how far to believe it."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import csm
from csm.errors import DataError
from csm.matching import PrecomputedMethod
from csm.mesh.io import read_mesh
from csm.viewer.match_folder import ACCOUNT, FILES, in_words, match_page, save_match, write_match
from tests.shapes import blob
from tests.viewer.test_scene import unpack

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def match(tmp_path_factory) -> csm.Match:
    return csm.match(blob(2), blob(1), "gps", refine="none", store=tmp_path_factory.mktemp("store"))


def test_the_folder_holds_the_map_and_how_it_was_made(match, tmp_path):
    write_match(match, tmp_path, "the method in words", 1.234)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([*FILES, ACCOUNT])
    account = json.loads((tmp_path / ACCOUNT).read_text())
    assert (account["method"], account["seconds"]) == ("nearest neighbour in the method in words", 1.23)
    assert account["source"]["vertices"] == 162
    with np.load(tmp_path / "map.npz") as kept:
        np.testing.assert_array_equal(kept["indices"], match.indices)
    assert read_mesh(tmp_path / "source.ply").digest == blob(2).digest


def test_the_tutorial_explains_every_key_of_the_account(match, tmp_path):
    write_match(match, tmp_path, "the method in words", 1.234)
    table = (ROOT / "docs" / "tutorial_match.md").read_text(encoding="utf-8").partition("`match.json` has")[2]
    explained = {key for line in table.splitlines() if line.startswith("| `") for key in line.split("|")[1].split("`")}
    assert set(json.loads((tmp_path / ACCOUNT).read_text())) <= explained


def test_an_unknown_time_is_left_out_and_the_method_is_said(match, tmp_path):
    save_match(match, tmp_path / "new" / "folder")
    account = json.loads((tmp_path / "new" / "folder" / ACCOUNT).read_text())
    assert "seconds" not in account
    assert account["method"] == f"nearest neighbour in the descriptor {match.method.descriptor}"


def test_files_that_are_there_are_not_replaced(match, tmp_path):
    (tmp_path / "match.html").write_text("mine")
    with pytest.raises(DataError, match=r"match\.html: there is such a file"):
        save_match(match, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["match.html"]
    (tmp_path / "file").write_text("mine")
    with pytest.raises(DataError, match="cannot be written"):
        save_match(match, tmp_path / "file")


def test_a_match_is_saved_again_over_its_own_files_and_over_no_others(match, tmp_path):
    match.save(tmp_path)
    before = (tmp_path / "map.txt").read_bytes()
    match.inverse.save(tmp_path)
    assert (tmp_path / "map.txt").read_bytes() != before
    assert len(np.loadtxt(tmp_path / "map.txt")) == match.target.n_vertices
    (tmp_path / "map.txt").write_text("mine")
    with pytest.raises(DataError, match=r"map\.txt: there is such a file, which has been changed.*overwrite=True"):
        match.save(tmp_path)
    assert (tmp_path / "map.txt").read_text() == "mine"
    match.save(tmp_path, overwrite=True)
    assert (tmp_path / "map.txt").read_bytes() == before


def test_a_match_is_never_saved_over_its_own_input(match, tmp_path):
    match.save(tmp_path)
    read = replace(match, source=read_mesh(tmp_path / "source.ply"))
    with pytest.raises(DataError, match=r"source\.ply: this is the input .*source\.ply, which would be replaced"):
        read.save(tmp_path, overwrite=True)


def test_the_page_has_both_names_and_the_verdict(match):
    page = match_page(match, in_words(match))
    assert match.confidence.verdict in page
    assert "of the target vertices are reached" in page


def test_methods_of_other_kinds_are_called_by_their_name(match):
    features = PrecomputedMethod({"blob": np.random.default_rng(0).random((162, 3))}, "mine")
    other = csm.match(blob(2), blob(2), features, refine="none")
    assert in_words(other) == "the descriptor mine"


def scene_of(page: str) -> dict[str, Any]:
    (scene,) = re.findall(r'<script type="application/json">(.*?)</script>', page)
    found: dict[str, Any] = json.loads(scene)
    return found


def test_the_page_has_the_map_its_confidence_and_its_verdict(match: csm.Match, tmp_path: Path) -> None:
    write_match(match, tmp_path, "GPS", 1.0)
    assert {path.name for path in tmp_path.iterdir()} == {*FILES, ACCOUNT}
    page = (tmp_path / "match.html").read_text(encoding="utf-8")
    source, target = scene_of(page)["panels"]
    np.testing.assert_array_equal(unpack(source["map"], "i4"), match.indices)
    np.testing.assert_allclose(unpack(source["confidence"], "f4"), match.confidence.values, atol=1e-6)
    assert "confidence" not in target
    assert page.index(match.confidence.verdict[:20]) < page.index("<canvas") < page.index("is mapped to a vertex of")


def test_without_descriptors_they_cannot_be_compared_in_the_page(match: csm.Match) -> None:
    assert 'data-mode="distance"' not in match_page(replace(match, features=None), "GPS")


def test_descriptors_can_be_compared_in_the_page(match: csm.Match, tmp_path: Path) -> None:
    features = match.source.vertices, match.target.vertices
    write_match(replace(match, features=features), tmp_path, "HKS", 1.0)
    page = (tmp_path / "match.html").read_text(encoding="utf-8")
    assert 'data-mode="distance"' in page
    scene = scene_of(page)
    here, there = (unpack(p["features"], "i1").reshape(-1, 3) * np.array(scene["steps"]) for p in scene["panels"])
    exact = np.linalg.norm(features[0][5] - features[1], axis=1)
    np.testing.assert_allclose(np.linalg.norm(here[5] - there, axis=1), exact, atol=0.05)
