from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import csm
from csm.descriptors import HKS
from csm.errors import DataError
from csm.matching.barycentric import nearest_on_faces
from csm.matching.confidence import there_and_back
from csm.mesh.shape import Mesh
from csm.viewer.match_folder import ACCOUNT, FILES
from tests.shapes import blob, rotation

CHEAP = HKS(k=20, n_times=8)
SOURCE = blob(2)
ORDER = np.random.default_rng(3).permutation(162)
TARGET = Mesh(2 * SOURCE.vertices[ORDER] @ rotation().T, np.argsort(ORDER)[SOURCE.faces], "shuffled")


@pytest.fixture(scope="module")
def match(tmp_path_factory) -> csm.Match:
    return csm.match(SOURCE, TARGET, CHEAP, refine="none", store=tmp_path_factory.mktemp("store"))


def test_the_inverse_is_the_map_the_other_way(match):
    back = match.inverse
    assert (back.source, back.target) == (match.target, match.source)
    np.testing.assert_array_equal(match.vertex_map, np.argsort(ORDER))
    np.testing.assert_array_equal(back.vertex_map, ORDER)
    assert (back.vertex_map.source, back.vertex_map.target) == ("shuffled", "blob")
    np.testing.assert_array_equal(match.vertex_map.compose(back.vertex_map), np.arange(162))
    assert repr(back) == "Match(shuffled -> blob by hks, nearest)"
    assert back.inverse is match
    assert match.inverse is back


def test_the_inverse_has_the_confidence_of_its_own_direction(tmp_path):
    match = csm.match(SOURCE, blob(3), CHEAP, refine="none", store=tmp_path)
    wanted = there_and_back(match.back.vertex_map, match.there.vertex_map, match.target)
    np.testing.assert_array_equal(match.inverse.confidence.distance, wanted)
    assert len(match.inverse.confidence.values) == 642
    assert match.inverse.coverage <= 1.0


def test_errors_are_those_of_the_map(match):
    assert match.errors(np.argsort(ORDER), "edge").max() == 0
    assert match.inverse.errors(ORDER, "edge").max() == 0
    assert match.errors(match.vertex_map, "edge", "sqrt_area").max() == 0
    assert match.errors(np.roll(np.argsort(ORDER), 1), "edge").min() > 0


def test_both_directions_transfer(match):
    height = SOURCE.vertices[:, 2]
    np.testing.assert_array_equal(match.transfer(height[ORDER]), height)
    np.testing.assert_array_equal(match.inverse.transfer(height), height[ORDER])
    np.testing.assert_array_equal(match.transfer([5, 0], "landmarks"), ORDER[[5, 0]])
    np.testing.assert_array_equal(match.inverse.transfer([5, 0], "landmarks"), np.argsort(ORDER)[[5, 0]])


def test_a_barycentric_map_is_used_where_there_is_one(match):
    assert match.barycentric is None
    assert match.functional_map is None
    np.testing.assert_array_equal(match.into_faces.vertex_map(), match.vertex_map)
    middle = SOURCE.vertices + 0.3 * (SOURCE.vertices[SOURCE.faces[0, 0]] - SOURCE.vertices)
    precise = nearest_on_faces(2 * middle @ rotation().T, TARGET.vertices, TARGET.faces)
    finer = replace(match, there=replace(match.there, precise=lambda: precise))
    assert finer.barycentric is precise
    np.testing.assert_allclose(finer.transfer(TARGET.vertices), precise.points(TARGET))


def test_a_match_is_saved_over_its_own_files_and_over_others_only_when_told_to(match, tmp_path):
    folder = match.save(tmp_path / "out")
    assert sorted(path.name for path in folder.iterdir()) == sorted([*FILES, ACCOUNT])
    match.save(str(tmp_path / "out"))
    (folder / "map.txt").write_text("mine")
    with pytest.raises(DataError, match=r"map\.txt: there is such a file, .*give another folder, or overwrite=True"):
        match.save(str(tmp_path / "out"))
    assert match.inverse.save(tmp_path / "out", overwrite=True) == folder
    lines = (folder / "map.txt").read_text().splitlines()[1:]
    np.testing.assert_array_equal([int(line) for line in lines], ORDER)


def test_a_match_is_shown_in_the_browser(match, monkeypatch):
    opened: list[str] = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    path = match.show()
    assert opened == [path.as_uri()]
    assert "blob → shuffled" in path.read_text(encoding="utf-8")
    path.unlink()
    path.parent.rmdir()
