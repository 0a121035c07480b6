import gzip

import numpy as np
import pytest

from csm.errors import MeshError
from csm.mesh.io import write_mesh
from csm.mesh.io.extras import read_extras
from tests.mesh.io.plyfiles import FACES, FORMS, MESH, XYZ, made

RGB = np.random.default_rng(0).integers(0, 256, (MESH.n_vertices, 3)).astype(np.uint8)
COLOURED = [(f"uchar {name}", RGB[:, i].tolist()) for i, name in enumerate(("red", "green", "blue"))]
ONES = [1.0] * MESH.n_vertices


@pytest.mark.parametrize("form", FORMS)
def test_colours_of_a_ply_and_names_of_the_rest(tmp_path, form):
    more = [("uchar alpha", [255] * MESH.n_vertices), ("float quality", ONES)]
    elements = {"vertex": [*XYZ, *COLOURED, *more], "face": [("list uchar int vertex_indices", FACES)]}
    (tmp_path / "a.ply").write_bytes(made(form, elements))
    (tmp_path / "a.ply.gz").write_bytes(gzip.compress(made(form, elements)))
    for name in ("a.ply", "a.ply.gz"):
        found = read_extras(tmp_path / name)
        np.testing.assert_array_equal(found.colors, RGB)
        assert found.others == ("alpha", "quality")


def test_colours_of_another_kind_are_named_only(tmp_path):
    floats = [(f"float {name}", ONES) for name in ("red", "green", "blue")]
    (tmp_path / "a.ply").write_bytes(made("ascii", {"vertex": [*XYZ, *floats]}))
    found = read_extras(tmp_path / "a.ply")
    assert found.colors is None
    assert found.others == ("red", "green", "blue")


@pytest.mark.parametrize("odd", [300, -1, 1.5])
def test_colours_of_a_text_file_that_are_no_bytes_are_not_carried(odd, tmp_path):
    head = "ply\nformat ascii 1.0\nelement vertex 3\n" + "".join(f"property float {c}\n" for c in "xyz")
    head += "".join(f"property uchar {c}\n" for c in ("red", "green", "blue"))
    head += "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    file = tmp_path / "a.ply"
    file.write_text(head + f"0 0 0 {odd} 1 2\n1 0 0 3 4 5\n0 1 0 6 7 8\n3 0 1 2\n")
    assert read_extras(file).colors is None
    assert read_extras(file).others == ("red", "green", "blue")


def test_what_an_obj_has_besides(tmp_path):
    file = tmp_path / "a.obj"
    file.write_text("v 0 0 0 1 0 0.2\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\nvt 0 0\nvn 0 0 1\nf 1/1/1 2/1/1 3/1/1\n")
    found = read_extras(file)
    assert found.others == ("texture coordinates", "normals")
    np.testing.assert_array_equal(found.colors, [[255, 0, 51], [0, 255, 0], [0, 0, 255]])
    file.write_text("v 0 0 0 200 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\nf 1 2 3\n")
    assert read_extras(file).others == ("colours",)
    assert read_extras(file).colors is None
    file.write_text("v 0 0 0 a b c\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\nf 1 2 3\n")
    assert read_extras(file).others == ("colours",)
    file.write_text("v 0 0 0 1\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert read_extras(file).others == ()


def test_what_an_off_has_besides_and_files_of_other_formats(tmp_path):
    write_mesh(tmp_path / "a.off", MESH, RGB)
    assert read_extras(tmp_path / "a.off").others == ("colours",)
    write_mesh(tmp_path / "b.off", MESH)
    assert read_extras(tmp_path / "b.off").others == ()
    np.savez(tmp_path / "c.npz", vertices=MESH.vertices, faces=MESH.faces)
    assert read_extras(tmp_path / "c.npz").others == ()
    (tmp_path / "d.ply").write_text("nonsense")
    with pytest.raises(MeshError, match=r"d\.ply"):
        read_extras(tmp_path / "d.ply")
