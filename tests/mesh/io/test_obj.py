from pathlib import Path

import numpy as np
import pytest

from csm.errors import MeshError
from csm.mesh.io import read_mesh, read_polygons
from csm.mesh.io.obj import format_obj, parse_obj
from tests.shapes import blob

CASES = Path(__file__).parents[2] / "cases"

POINTS = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"
VERTICES = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
TRIANGLES = np.array([[0, 2, 1], [0, 1, 3]])

VARIANTS = {
    "v": POINTS + "f 1 3 2\nf 1 2 4\n",
    "v/vt": POINTS + "vt 0 0\nvt 1 1\nf 1/1 3/2 2/1\nf 1/2 2/2 4/1\n",
    "v//vn": POINTS + "vn 0 0 1\nf 1//1 3//1 2//1\nf 1//1 2//1 4//1\n",
    "v/vt/vn": POINTS + "vt 0 0\nvt 1 0\nvn 0 0 1\nf 1/1/1 3/1/1 2/2/1\nf 1/2/1 2/1/1 4/1/1\n",
    "counted back": POINTS + "f -4 -2 -3\nf -4 -3 -1\n",
    "counted back in between": "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -1 -2\nv 0 0 1\nf -4 -3 -1\n",
    "comments, groups, materials": "# obj\nmtllib a.mtl\no thing\n"
    + POINTS
    + "g part\nusemtl skin\ns 1\nf 1 3 2 # one\n\nl 1 2\np 1\nf 1 2 4\n",
    "colours and w": POINTS.replace("\n", " 0.1 0.2 0.3\n") + "f 1 3 2\nf 1 2 4\n",
    "windows": (POINTS + "f 1 3 2\nf 1 2 4\n").replace("\n", "\r\n"),
    "continued line": POINTS + "f 1 \\\n3 2\nf 1 2 4\n",
}


@pytest.mark.parametrize("text", VARIANTS.values(), ids=VARIANTS.keys())
def test_every_variant_gives_the_same_mesh(text):
    raw = parse_obj(text.encode())
    np.testing.assert_array_equal(raw.vertices, VERTICES)
    np.testing.assert_array_equal(raw.faces, TRIANGLES)


def test_unreferenced_and_repeated_vertices_stay():
    raw = parse_obj(b"v 5 5 5\n" + POINTS.encode() + POINTS.encode() + b"f 2 3 4\n")
    assert len(raw.vertices) == 9
    np.testing.assert_array_equal(raw.faces, [[1, 2, 3]])


BROKEN = {
    "cut in its last line": (POINTS + "f 1 2 3\nf 2 3 4\nf 4 1 ", "file ends in the middle of face 2 .*cut short"),
    "empty last line": (POINTS + "f 1 2 3\nf\n", "file ends in the middle of face 1"),
    "vertices missing": (POINTS + "f 1 2 3\nf 1 2 5\n", r"face 1 refers to vertex 5, but there are 4 \(1..4\)"),
    "zero": (POINTS + "f 0 1 2\n", "counts vertices from 1"),
    "too far back": (POINTS + "f -5 -1 -2\n", "only 4 precede"),
    "words": (POINTS + "f a b c\n", "face 0 is 'f a b c'"),
    "short vertex": ("v 0 0 0\nv 1 0\n", "vertex 1 is '1 0'"),
    "no vertices": ("hello\n", "no OBJ mesh"),
}


@pytest.mark.parametrize(("text", "message"), BROKEN.values(), ids=BROKEN.keys())
def test_broken_files_say_what_is_wrong(text, message):
    with pytest.raises(MeshError, match=message):
        parse_obj(text.encode())


def test_polygons_are_kept_with_their_corners():
    raw = parse_obj((POINTS + "f 1 2 3\nf 1/1 2/1 3/1 4/1\nf 1 2\nf -1 -2 -3\n").encode())
    assert raw.sizes.tolist() == [3, 4, 2, 3]
    assert raw.corners.tolist() == [0, 1, 2, 0, 1, 2, 3, 0, 1, 3, 2, 1]


def test_faces_of_two_corners_are_named_with_their_line(tmp_path):
    raw = parse_obj(("# edges\n" + POINTS + "f 1 2 3\nf 1 2\nf 2 3 \\\n4\nf 3 4\n").encode())
    assert raw.sizes.tolist() == [3, 2, 3, 2]
    line = POINTS.count("\n") + 3
    assert raw.notes == (f"line {line} has a face of 2 corners (the first of 2 such faces), wanted three or more",)
    with pytest.raises(MeshError, match=r"line 5 has a face of 2 corners.*these are edges"):
        parse_obj(b"v 0 0 0\nv 1 0 0\nv 1 1 0\n\nf 1 2\nf 2 3\n")
    (tmp_path / "a.obj").write_text(POINTS + "f 1 2 3\nf 1 2\nf 2 3 4\n")
    with pytest.raises(MeshError, match="leaves out those of fewer than three corners"):
        read_mesh(tmp_path / "a.obj")
    assert len(read_polygons(tmp_path / "a.obj").triangulated().mesh.faces) == 2


def test_vertices_of_no_face_are_a_note_since_a_cut_file_has_them():
    (note,) = parse_obj((POINTS + "f 1 2 3\n").encode()).notes
    assert "1 of 4 vertices belong to no face" in note
    assert "4 of 4 vertices belong to no face" in parse_obj(POINTS.encode()).notes[0]
    assert parse_obj((POINTS + "f 1 2 3\nf 1 2 4\n").encode()).notes == ()


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_a_byte_order_mark_costs_no_vertex(encoding):
    raw = parse_obj((POINTS + "f 1 3 2\nf 1 2 4\n").encode(encoding))
    np.testing.assert_array_equal(raw.vertices, VERTICES)
    np.testing.assert_array_equal(raw.faces, TRIANGLES)


@pytest.mark.parametrize("name", ["cut_in_face_line", "empty_face_line"])
def test_cases_that_were_cut_are_named_and_not_told_to_triangulate(name):
    with pytest.raises(MeshError, match=rf"{name}\.obj: the file ends in the middle of face 12(79|80)") as caught:
        read_mesh(CASES / f"{name}.obj")
    assert "triang" not in str(caught.value)


@pytest.mark.parametrize("name", ["bom.obj", "bom.off"])
def test_cases_with_a_byte_order_mark_are_the_mesh_of_the_others(name):
    mesh, reference = read_mesh(CASES / name), read_mesh(CASES / "plain.off.gz")
    np.testing.assert_allclose(mesh.vertices, reference.vertices, atol=1e-12)
    np.testing.assert_array_equal(mesh.faces, reference.faces)


@pytest.mark.parametrize("keep", range(1, 80, 7))
def test_a_file_cut_anywhere_is_refused_or_noted(keep):
    """As long as the faces that are left leave a vertex out; a cut behind that only opens a hole."""
    data = format_obj(blob(1))
    cut = data[: keep * len(data) // 100]
    try:
        raw = parse_obj(cut)
    except MeshError:
        return
    assert raw.notes
