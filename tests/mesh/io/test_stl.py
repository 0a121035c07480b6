import numpy as np
import pytest
import trimesh

from csm.errors import MeshError
from csm.mesh.io.stl import parse_stl
from tests.shapes import blob

MESH = blob(1)


@pytest.mark.parametrize("kind", ["stl", "stl_ascii"])
def test_triangles_stay_apart_and_in_order(kind):
    exported = trimesh.Trimesh(MESH.vertices, MESH.faces, process=False).export(file_type=kind)
    raw = parse_stl(exported if isinstance(exported, bytes) else exported.encode())
    assert raw.vertices.shape == (3 * MESH.n_faces, 3)
    np.testing.assert_allclose(raw.vertices[raw.faces], MESH.corners, rtol=1e-5, atol=1e-7)


def test_an_assembly_of_several_solids_is_refused():
    solid = trimesh.Trimesh(MESH.vertices, MESH.faces, process=False).export(file_type="stl_ascii")
    with pytest.raises(MeshError, match="holds 2 solids"):
        parse_stl((solid.replace("solid", "solid a", 1) + "\n" + solid.replace("solid", "solid b", 1)).encode())


def test_an_empty_file_of_the_format_is_refused():
    with pytest.raises(MeshError, match="empty or damaged"):
        parse_stl(b"\0" * 80 + (0).to_bytes(4, "little"))
