from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from csm.errors import MeshError
from csm.mesh.io import read_mesh, read_polygons
from csm.mesh.io.ply import counts_ply, format_ply, parse_ply
from csm.mesh.polygons import triangulated
from csm.mesh.shape import Mesh
from tests.mesh.io.plyfiles import FORMS, MESH, XYZ, made


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


def strip_by_hand(strip: list[int]) -> list[list[int]]:
    """The rule in words: each corner makes a triangle with the two before it, every second one turned round."""
    found, run = [], []
    for corner in strip:
        run = [] if corner == -1 else [*run, corner]
        if len(run) >= 3:
            a, b, c = run[-3:]
            if len({a, b, c}) == 3:
                found.append([a, b, c] if len(run) % 2 else [b, a, c])
    return found


@given(st.lists(st.lists(st.integers(-1, 5), max_size=9), min_size=1, max_size=4), st.sampled_from(FORMS))
def test_strips_become_triangles_of_one_orientation(strips, form):
    raw = parse_ply(made(form, {"vertex": XYZ, "tristrips": [("list int int vertex_indices", strips)]}))
    assert raw.faces.tolist() == [triangle for strip in strips for triangle in strip_by_hand(strip)]


def test_faces_and_strips_add_up_and_that_is_noted():
    lists = "list int int vertex_indices"
    raw = parse_ply(
        made("ascii", {"vertex": XYZ, "face": [(lists, [[5, 6, 7]])], "tristrips": [(lists, [[0, 1, 2, 3]])]})
    )
    assert raw.faces.tolist() == [[5, 6, 7], [0, 1, 2], [2, 1, 3]]
    assert raw.notes == ("2 triangles were taken from 1 triangle strip",)


CASES = Path(__file__).parents[2] / "cases"


@pytest.mark.parametrize("name", ["ascii_blank_lines", "trailing_bytes_bin", "vertex_with_varying_list_property"])
def test_sound_cases_are_read(name):
    reference, mesh = read_mesh(CASES / "plain.off.gz"), read_mesh(CASES / f"{name}.ply")
    np.testing.assert_allclose(mesh.vertices, reference.vertices, atol=1e-6)
    np.testing.assert_array_equal(mesh.faces, reference.faces)


def test_the_cube_of_quads_and_the_mixed_one_have_its_area():
    for name, sizes in (("quads", [4] * 6), ("mixed_tri_quad_bin", None)):
        cube = read_polygons(CASES / f"{name}.ply")
        assert sizes is None or cube.sizes.tolist() == sizes
        extent = np.ptp(cube.vertices, axis=0)
        made = triangulated(cube)
        assert made.mesh.area == pytest.approx(2 * (extent * np.roll(extent, 1)).sum())
        assert len(made.face_map) == made.mesh.n_faces


def test_the_strips_of_the_case():
    assert read_mesh(CASES / "tristrips.ply").faces.tolist() == [[0, 1, 3], [3, 1, 2], [3, 2, 6], [4, 5, 7]]


@pytest.mark.parametrize(
    ("name", "message"), [("odd_values", "line 'elemenloat q'"), ("ragged", "vertex 161 is '3 0 42 44'")]
)
def test_damaged_cases_give_one_sentence(name, message):
    with pytest.raises(MeshError, match=rf"{name}\.ply: .*{message}"):
        read_mesh(CASES / "damaged" / f"{name}.ply")


def test_what_is_no_ply_is_refused():
    with pytest.raises(MeshError, match="PLY header"):
        parse_ply(b"OFF\n1 1 1\n")
    with pytest.raises(MeshError, match="no element 'vertex'"):
        parse_ply(b"ply\nformat ascii 1.0\nend_header\n")
