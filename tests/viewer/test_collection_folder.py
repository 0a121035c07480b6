from __future__ import annotations

import json
import re

import numpy as np
import pytest

import csm
from csm.errors import ConfigError, DataError
from csm.mesh.io import read_mesh
from csm.viewer import collection_folder
from csm.viewer.collection_folder import chosen_pairs, places, save_collection, verdict, write_collection
from tests.matching.collection.copies import QUICK, copies


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    store = tmp_path_factory.mktemp("store")
    return csm.match_collection(copies(3), "wks", refiner=QUICK, store=store, workers=0, progress=False)


def files(folder) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


def test_everything_is_written_and_accounted_for(found, tmp_path):
    out = found.save(tmp_path / "out", pairs="reference")
    wanted = {n for n in places(found.names) if not n.startswith("maps/") or found.reference in n}
    account = json.loads((out / "collection.json").read_text())
    assert files(out) == {*wanted, "collection.json"}
    assert set(account["files"]) == wanted
    assert account["reference"] == found.reference
    assert account["verdict"] == verdict(found) == "the maps of 3 of 3 pairs agree with those of all others"
    assert [pair["source"] for pair in account["pairs"]] == ["s0", "s0", "s1"]
    other = next(name for name in found.names if name != found.reference)
    read = np.loadtxt(out / f"maps/{other}_to_{found.reference}.txt", dtype=int)
    assert np.array_equal(read, found.vertex_map(other, found.reference).indices)
    assert np.array_equal(read_mesh(out / "shapes/s1.ply").faces, found.meshes[1].faces)
    assert (out / "reference.ply").read_bytes() == (out / f"shapes/{found.reference}.ply").read_bytes()
    page = (out / "collection.html").read_text()
    assert all(re.search(f'"label": "{name}"', page) for name in found.names)


def test_another_choice_of_pairs_replaces_the_own_maps_of_an_earlier_run(found, tmp_path):
    write_collection(found, tmp_path, pairs="all", workers=0, progress=False)
    changed = next(n for n in places(found.names) if n.startswith("maps/") and found.reference not in n)
    other = next(n for n in places(found.names)[::-1] if n.startswith("maps/") and found.reference not in n)
    (tmp_path / changed).write_text("mine")
    (tmp_path / "maps/of_my_own.txt").write_text("mine")
    assert write_collection(found, tmp_path, pairs="reference", workers=0, progress=False) == 4
    left = files(tmp_path)
    assert other not in left
    assert {changed, "maps/of_my_own.txt"} <= left  # what was changed, or is not csm's, stays


def test_what_is_there_is_replaced_only_when_told_to(found, tmp_path):
    (tmp_path / "shapes").mkdir()
    (tmp_path / "shapes/s1.ply").write_text("mine")
    with pytest.raises(DataError, match=r"s1\.ply: there is such a file"):
        save_collection(found, tmp_path)
    with pytest.raises(ConfigError, match="pairs=some: wanted auto, all or reference"):
        found.save(tmp_path, pairs="some", overwrite=True)
    assert files(tmp_path) == {"shapes/s1.ply"}
    found.save(tmp_path, pairs="reference", overwrite=True)
    assert read_mesh(tmp_path / "shapes/s1.ply").n_vertices == 642


def test_a_collection_is_saved_again_over_its_own_files(found, tmp_path):
    found.save(tmp_path, pairs="all")
    found.save(tmp_path, pairs="reference")
    assert len(list((tmp_path / "maps").iterdir())) == 4
    (tmp_path / "collection.json").write_text("{}")
    with pytest.raises(DataError, match=r"there is such a file, which was not written by csm here"):
        found.save(tmp_path)
    assert (tmp_path / "collection.json").read_text() == "{}"


def test_a_write_that_fails_leaves_nothing(found, tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(collection_folder, "write_html", full)
    with pytest.raises(OSError, match="No space"):
        write_collection(found, tmp_path, workers=0, progress=False)
    assert files(tmp_path) == set()


def test_names_become_file_names_that_every_system_takes():
    assert places(["a/b", "c"])[2:] == ["shapes/a_b.ply", "shapes/c.ply", "maps/a_b_to_c.txt", "maps/c_to_a_b.txt"]


def test_all_pairs_of_few_shapes_and_those_of_the_reference_of_many():
    assert len(chosen_pairs(20, 0, "auto")) == 380
    assert len(chosen_pairs(21, 4, "auto")) == 40
    assert all(4 in pair for pair in chosen_pairs(21, 4, "auto"))
    assert len(chosen_pairs(21, 4, "all")) == 420


@pytest.mark.parametrize("names", [["a", "b", "a_to_b", "b_to_b"], ["a/b", "a_b"]])
def test_names_that_would_share_a_file_are_refused(names):
    with pytest.raises(ConfigError, match=r"would be the file of two .* give the meshes other names"):
        places(names)
