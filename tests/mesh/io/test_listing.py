import json

import numpy as np

from csm.mesh.io import file_digest, write_mesh
from csm.mesh.io.listing import listed_meshes, written_meshes
from tests.shapes import blob


def test_meshes_come_before_arrays_and_what_is_left_out_is_said(tmp_path):
    for name in ("b.npz", "a.npz"):
        np.savez(tmp_path / name, vertices=blob(1).vertices, faces=blob(1).faces)
    found = listed_meshes(tmp_path)
    assert [path.name for path in found.files] == ["a.npz", "b.npz"]
    assert found.left_out == ""
    write_mesh(tmp_path / "a.off", blob(1))
    found = listed_meshes(tmp_path)
    assert [path.name for path in found.files] == ["a.off"]
    assert found.left_out == "a.npz and b.npz, which may be no meshes"
    for i in range(5):
        np.savez(tmp_path / f"c{i}.npz", i)
    assert listed_meshes(tmp_path).left_out == "a.npz, b.npz, c0.npz, c1.npz, c2.npz and 2 more, which may be no meshes"


def test_what_a_match_wrote_is_left_out_as_long_as_it_is_as_it_was(tmp_path):
    assert listed_meshes(tmp_path / "gone") == ([], [], [])
    for name in ("a.off", "source.ply", "below/c.ply"):
        write_mesh(tmp_path / name, blob(1))
    names = ("source.ply", "below/c.ply", "gone.ply")
    digest = file_digest(tmp_path / "source.ply")
    (tmp_path / "match.json").write_text(json.dumps({"files": dict.fromkeys(names, digest)}))
    assert written_meshes(tmp_path) == {"source.ply"}
    assert listed_meshes(tmp_path).left_out == "source.ply, which csm match has written there"
    write_mesh(tmp_path / "source.ply", blob(2))
    assert written_meshes(tmp_path) == frozenset()
    assert [path.name for path in listed_meshes(tmp_path).files] == ["a.off", "source.ply"]
