import numpy as np
import pytest
import trimesh

from csm.errors import MeshError
from csm.mesh.io.ply import counts_ply, format_ply, parse_ply
from csm.mesh.shape import Mesh
from tests.shapes import blob

MESH = blob(1)


def header(form: str, vertex: str = "property float x\nproperty float y\nproperty float z\n", faces: int = -1) -> bytes:
    n = MESH.n_faces if faces < 0 else faces
    return (
        f"ply\nformat {form} 1.0\ncomment by hand\nelement vertex {MESH.n_vertices}\n{vertex}"
        f"element face {n}\nproperty list uchar int vertex_indices\nend_header\n"
    ).encode()


def binary(order: str) -> bytes:
    faces = np.empty(MESH.n_faces, dtype=[("n", "u1"), ("f", f"{order}i4", 3)])
    faces["n"], faces["f"] = 3, MESH.faces
    form = "binary_little_endian" if order == "<" else "binary_big_endian"
    return header(form) + MESH.vertices.astype(f"{order}f4").tobytes() + faces.tobytes()


def text(extra: str = "") -> bytes:
    rows = [" ".join(map(repr, row)) + extra for row in MESH.vertices.tolist()]
    rows += [f"3 {a} {b} {c}" for a, b, c in MESH.faces.tolist()]
    return ("\n".join(rows) + "\n").encode()


@pytest.mark.parametrize("order", ["<", ">"])
def test_binary_of_both_byte_orders(order):
    raw = parse_ply(binary(order))
    np.testing.assert_array_equal(raw.vertices, MESH.vertices.astype(np.float32))
    np.testing.assert_array_equal(raw.faces, MESH.faces)


def test_ascii():
    raw = parse_ply(header("ascii") + text())
    np.testing.assert_allclose(raw.vertices, MESH.vertices, rtol=1e-6)
    np.testing.assert_array_equal(raw.faces, MESH.faces)


def test_extra_vertex_properties_do_not_split_vertices():
    extra = "property float x\nproperty float y\nproperty float z\nproperty float s\nproperty float t\n"
    raw = parse_ply(header("ascii", extra + "property uchar red\n") + text(" 0.5 0.5 7"))
    np.testing.assert_allclose(raw.vertices, MESH.vertices, rtol=1e-6)
    np.testing.assert_array_equal(raw.faces, MESH.faces)


@pytest.mark.parametrize("encoding", ["ascii", "binary"])
def test_unreferenced_and_repeated_vertices_stay(encoding):
    vertices = np.array([[9.0, 9, 9], [0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 0], [1, 0, 0], [0, 1, 0]])
    faces = np.array([[1, 2, 3], [4, 6, 5]])
    exported = trimesh.Trimesh(vertices, faces, process=False).export(file_type="ply", encoding=encoding)
    raw = parse_ply(exported)
    np.testing.assert_array_equal(raw.vertices, vertices)
    np.testing.assert_array_equal(raw.faces, faces)


def test_colours_are_what_others_read():
    colors = np.random.default_rng(0).integers(0, 256, (MESH.n_vertices, 3)).astype(np.uint8)
    other = trimesh.load(trimesh.util.wrap_as_stream(format_ply(MESH, colors)), file_type="ply", process=False)
    np.testing.assert_array_equal(np.asarray(other.visual.vertex_colors)[:, :3], colors)
    np.testing.assert_array_equal(other.vertices, MESH.vertices)
    np.testing.assert_array_equal(other.faces, MESH.faces)


def test_counts_come_from_the_header():
    assert counts_ply(format_ply(MESH)) == (MESH.n_vertices, MESH.n_faces)


def test_a_mesh_without_faces_is_read_as_such():
    cloud = Mesh(MESH.vertices, np.zeros((0, 3), dtype=int))
    raw = parse_ply(format_ply(cloud))
    assert raw.faces.shape == (0, 3)
    np.testing.assert_array_equal(raw.vertices, MESH.vertices)


def test_quads_are_refused_not_cut_into_triangles():
    body = text().decode().splitlines()
    quad = "\n".join([*body[:-1], "4 0 1 2 3"]) + "\n"
    with pytest.raises(MeshError, match="more than three corners"):
        parse_ply(header("ascii") + quad.encode())


def test_what_is_no_ply_is_refused():
    with pytest.raises(MeshError, match="PLY header"):
        parse_ply(b"OFF\n1 1 1\n")
    with pytest.raises(MeshError, match="no element 'vertex'"):
        parse_ply(b"ply\nformat ascii 1.0\nend_header\n")
