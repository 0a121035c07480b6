from __future__ import annotations

import numpy as np
import pytest

import csm
from csm.errors import ConfigError, DataError
from csm.matching.collection import match_collection
from csm.matching.collection.shapes import mesh_files, named_shapes
from csm.mesh.io import write_mesh
from tests.shapes import blob


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    return csm.Store(tmp_path_factory.mktemp("store"))


def test_a_folder_is_read_in_natural_order_and_arrays_are_no_meshes_beside_meshes(tmp_path):
    for name in ("b10.off", "b9.ply"):
        write_mesh(tmp_path / name, blob(2))
    np.savez(tmp_path / "values.npz", values=np.zeros(3))
    (tmp_path / "notes.txt").write_text("no mesh")
    assert [path.name for path in mesh_files(tmp_path)] == ["b9.ply", "b10.off"]
    assert list(named_shapes(str(tmp_path))) == ["b9.ply", "b10.off"]


def test_what_is_no_collection_is_named(tmp_path, store):
    write_mesh(tmp_path / "a.off", blob(2))
    with pytest.raises(DataError, match="gone: there is no such folder"):
        match_collection(tmp_path / "gone")
    with pytest.raises(DataError, match="has 1 mesh file, wanted two or more"):
        match_collection(tmp_path)
    with pytest.raises(ConfigError, match="a collection of 1 shape"):
        match_collection([blob(2)])
    write_mesh(tmp_path / "a.ply", blob(2))
    with pytest.raises(DataError, match=r"a\.ply and .*a\.off have one name, 'a'"):
        match_collection(tmp_path, store=store)


def test_what_a_match_has_written_is_no_shape_of_the_folder(tmp_path, store, caplog):
    for name in ("a.off", "b.off"):
        write_mesh(tmp_path / name, blob(2))
    csm.match(tmp_path / "a.off", tmp_path / "b.off", "gps", refine="none", store=store).save(tmp_path)
    assert [path.name for path in mesh_files(tmp_path)] == ["a.off", "b.off"]
    (told,) = caplog.messages
    assert told.endswith("2 shapes besides source.ply and target.ply, which csm match has written there")
    write_mesh(tmp_path / "target.ply", blob(1))  # what was changed since is the user's own
    assert [path.name for path in mesh_files(tmp_path)] == ["a.off", "b.off", "target.ply"]
    (tmp_path / "a.off").unlink()
    (tmp_path / "target.ply").unlink()
    with pytest.raises(DataError, match=r"has 1 mesh file besides source\.ply, which csm match has written there"):
        mesh_files(tmp_path)


def test_another_program_may_have_a_match_json(tmp_path):
    for name in ("a.off", "b.off"):
        write_mesh(tmp_path / name, blob(2))
    (tmp_path / "match.json").write_text('{"files": {"a.off": "0123", "../c.off": 3}}')
    assert [path.name for path in mesh_files(tmp_path)] == ["a.off", "b.off"]
