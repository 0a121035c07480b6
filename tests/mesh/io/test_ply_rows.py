import time

import numpy as np
import pytest

from csm.errors import MeshError
from csm.mesh.io.ply import parse_ply
from tests.mesh.io.plyfiles import FACES, FORMS, MESH, XYZ, V, made


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("length", ["char", "uchar", "short", "ushort", "int", "uint"])
@pytest.mark.parametrize("index", ["short", "uint", "int", "double"])
def test_lists_of_any_type_of_number(form, length, index):
    raw = parse_ply(made(form, {"vertex": XYZ, "face": [(f"list {length} {index} vertex_index", FACES)]}))
    np.testing.assert_array_equal(raw.vertices, MESH.vertices)
    np.testing.assert_array_equal(raw.faces, MESH.faces)


@pytest.mark.parametrize("form", FORMS)
def test_lists_of_varying_length_anywhere_are_stepped_over(form):
    n, m = MESH.n_vertices, MESH.n_faces
    views = ("list uchar int views", [list(range(i % 4)) for i in range(n)])
    texture = ("list uchar float texcoord", [[0.5] * (6 if i % 3 else 0) for i in range(m)])
    elements = {
        "camera": [("list int double rays", [[1.0, 2.0], []]), ("uchar on", [1, 0])],
        "vertex": [XYZ[2], views, XYZ[0], ("uchar red", [7] * n), XYZ[1]],
        "edge": [("int vertex1", [0, 1]), ("int vertex2", [1, 2])],
        "face": [("uchar flag", [1] * m), texture, ("list uchar int vertex_indices", FACES), ("float q", [0.5] * m)],
        "after": [("list uchar uchar name", [[1], []])],
    }
    raw = parse_ply(made(form, elements))
    np.testing.assert_array_equal(raw.vertices, MESH.vertices)
    np.testing.assert_array_equal(raw.faces, MESH.faces)
    assert raw.notes == ()


@pytest.mark.parametrize("form", FORMS)
def test_polygons_are_kept_with_their_corners(form):
    polygons = [[0, 1, 2], [0, 1, 2, 3], [], [4, 5], [1, 2, 3, 4, 5]]
    raw = parse_ply(made(form, {"vertex": XYZ, "face": [("list uchar int vertex_indices", polygons)]}))
    assert raw.sizes.tolist() == [3, 4, 0, 2, 5]
    assert raw.corners.tolist() == [corner for polygon in polygons for corner in polygon]


def test_what_follows_the_last_element_is_a_note():
    for form, said in (
        ("ascii", "1 line follows the last element; it was not read"),
        ("binary_little_endian", "4 bytes follow the last element; they were not read"),
    ):
        data = made(form, {"vertex": XYZ, "face": [("list uchar int vertex_indices", FACES)]}) + b"rest"
        assert parse_ply(data).notes == (said,)


def test_blank_lines_count_for_nothing():
    data = made("ascii", {"vertex": XYZ, "face": [("list uchar int vertex_indices", FACES)]}).replace(b"\n", b"\n \n\n")
    np.testing.assert_array_equal(parse_ply(data).faces, MESH.faces)


@pytest.mark.parametrize("form", FORMS)
def test_a_cut_anywhere_is_an_error(form):
    data = made(form, {"vertex": XYZ, "face": [("list uchar int vertex_indices", [*FACES[:5], [0, 1, 2, 3]])]})
    for end in [*range(0, len(data) - 2, 7), len(data) - 2]:
        with pytest.raises(MeshError, match=r"cut short|wanted"):
            parse_ply(data[:end])


BROKEN = {
    "ragged": ("1 2 3\n4 5\n6 7 8\n", "vertex 1 is '4 5', wanted the numbers x y z"),
    "blank instead of a vertex": ("1 2 3\n\n6 7 8\n3 0 1 2\n", "vertex 2 is '3 0 1 2', wanted the numbers x y z"),
    "word": ("1 2 3\n4 five 6\n7 8 9\n", "vertex 1 is '4 five 6'"),
    "face too short": (
        "1 2 3\n4 5 6\n7 8 9\n3 0 1\n",
        r"face 0 is '3 0 1', wanted the numbers \(list\) vertex_indices",
    ),
    "no length": ("1 2 3\n4 5 6\n7 8 9\n-3 0 1 2\n", "face 0 is '-3 0 1 2'"),
}


@pytest.mark.parametrize(("body", "message"), BROKEN.values(), ids=BROKEN.keys())
def test_a_row_that_is_not_what_the_header_says_is_named(body, message):
    head = f"ply\nformat ascii 1.0\nelement vertex 3\n{V}element face 1\n"
    head += "property list uchar int vertex_indices\nend_header\n"
    with pytest.raises(MeshError, match=message):
        parse_ply((head + body + "3 0 1 2\n").encode())


@pytest.mark.parametrize("form", FORMS[1:])
def test_announced_numbers_are_not_believed(form):
    for count in (10**9, 10**17):
        head = f"ply\nformat {form} 1.0\nelement vertex {count}\n{V}property list uint int a\nend_header\n".encode()
        with pytest.raises(MeshError, match="cut short"):
            parse_ply(head + b"\0" * 100)
    head = f"ply\nformat {form} 1.0\nelement none {10**17}\nelement vertex 1\n{V}end_header\n".encode()
    assert parse_ply(head + b"\0" * 12).vertices.tolist() == [[0, 0, 0]]


def test_large_binary_files_are_read_in_no_time():
    n = 100_000
    points = np.zeros(n, dtype=[("xyz", "<f4", 3), ("c", "u1", 4)])
    faces = np.zeros(2 * n, dtype=[("n", "u1"), ("v", "<i4", 3)])
    faces["n"] = 3
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {n}\n{V}" + "".join(
        f"property uchar {c}\n" for c in "rgba"
    )
    head += f"element face {2 * n}\nproperty list uchar int vertex_indices\nend_header\n"
    start = time.perf_counter()
    raw = parse_ply(head.encode() + points.tobytes() + faces.tobytes())
    assert time.perf_counter() - start < 1
    assert (len(raw.vertices), len(raw.sizes)) == (n, 2 * n)
