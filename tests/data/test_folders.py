from __future__ import annotations

import pickle
import shutil
from pathlib import Path

import pytest

from csm.data.folders import absent, listed_pairs, stems
from csm.data.registry import recognise
from csm.data.shapes import ShapeSet
from csm.errors import CsmError, DataError
from csm.mesh.io import write_mesh
from tests.data import layouts
from tests.shapes import sphere


def test_two_files_of_one_name_are_refused(tmp_path):
    write_mesh(tmp_path / "a.off", sphere(1))
    write_mesh(tmp_path / "a.ply", sphere(1))
    with pytest.raises(DataError, match="one name"):
        recognise(tmp_path)
    with pytest.raises(DataError, match=r"a\.ply and a\.off have one name"):
        stems([tmp_path / "a.off", tmp_path / "a.ply"])


def test_an_unknown_shape_is_named(tmp_path):
    with pytest.raises(DataError, match=r"no shape 'cow' among the 3"):
        recognise(layouts.sga18(tmp_path)).load("cow")


def test_nothing_is_read_before_it_is_asked_for(tmp_path):
    layouts.sga18(tmp_path)
    (tmp_path / "vtx_5k" / "cat0.off").write_text("nonsense")
    shapes = recognise(tmp_path)
    assert shapes.load("cat10").mesh.n_vertices == 42
    with pytest.raises(CsmError, match=r"cat0\.off"):
        shapes.load("cat0")


def test_a_mesh_that_is_read_already_is_joined_with_its_maps(tmp_path):
    shapes = recognise(layouts.sga18(tmp_path))
    mesh = shapes.mesh("cat10")
    joined, loaded = shapes.with_maps("cat10", mesh), shapes.load("cat10")
    assert joined.mesh is mesh
    assert joined.truth.indices.tolist() == loaded.truth.indices.tolist()
    assert joined.mirror.indices.tolist() == loaded.mirror.indices.tolist()


def test_a_set_serves_data_modules_and_their_worker_processes(tmp_path):
    shapes: ShapeSet = recognise(layouts.acd(tmp_path))
    copy = pickle.loads(pickle.dumps(shapes))
    assert copy.names == shapes.names
    assert copy.layout == shapes.layout
    assert copy.load("mesh000").mesh.digest == shapes.load("mesh000").mesh.digest


def test_the_folder_is_not_changed(tmp_path):
    layouts.sga18(tmp_path / "a")
    shutil.copytree(tmp_path / "a", tmp_path / "b")
    shapes = recognise(tmp_path / "a")
    for name in shapes.names:
        shapes.load(name)
    before = {p.relative_to(tmp_path / "b"): p.read_bytes() for p in (tmp_path / "b").rglob("*") if p.is_file()}
    after = {p.relative_to(tmp_path / "a"): p.read_bytes() for p in (tmp_path / "a").rglob("*") if p.is_file()}
    assert before == after


def test_the_files_of_a_set_are_meshes_maps_and_lists(tmp_path):
    files = recognise(layouts.acd(tmp_path)).files
    assert sorted(path.relative_to(tmp_path).as_posix() for path in files) == [
        "files_test.txt",
        "files_train.txt",
        "labels/mesh000.mat",
        "labels/mesh052.mat",
        "shapes/mesh000.mat",
        "shapes/mesh052.mat",
    ]


def test_pairs_and_missing_files_are_listed(tmp_path):
    assert listed_pairs(tmp_path) == ((), ())
    layouts.shrec19(tmp_path / "set")
    assert listed_pairs(tmp_path / "set") == ((("1", "2"), ("1", "10")), (tmp_path / "set" / "test_pairs.txt",))
    (lacking,) = absent(["a", "b"], {"a": tmp_path}, Path("maps"), ".vts", "somewhere")
    assert (lacking.path, lacking.origin) == ("maps/b.vts", "somewhere")
