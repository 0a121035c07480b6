import numpy as np
import pytest

from csm.errors import MeshError
from csm.mesh.io.off import count_off, format_off, parse_off
from tests.shapes import blob

POINTS = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n"
FACES = "3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n"
VERTICES = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
TRIANGLES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
NORMALS = "0 0 0 1 0 0\n1 0 0 1 0 0\n0 1 0 1 0 0\n0 0 1 1 0 0\n"

VARIANTS = {
    "plain": f"OFF\n4 4 6\n{POINTS}{FACES}",
    "zero edges": f"OFF\n4 4 0\n{POINTS}{FACES}",
    "no edge count": f"OFF\n4 4\n{POINTS}{FACES}",
    "counts on the keyword's line": f"OFF 4 4 6\n{POINTS}{FACES}",
    "counts glued to the keyword": f"OFF4 4 6\n{POINTS}{FACES}",
    "no keyword": f"4 4 6\n{POINTS}{FACES}",
    "lower case": f"off\n4 4 6\n{POINTS}{FACES}",
    "comments": f"# made by hand\nOFF # a mesh\n# counts\n4 4 6 # v f e\n\n{POINTS}# faces\n{FACES}# end\n",
    "blanks": f"\n OFF \n\n  4\t4   6\n\n{POINTS}\n\n{FACES}\n\n",
    "windows": f"OFF\n4 4 6\n{POINTS}{FACES}".replace("\n", "\r\n"),
    "old mac": f"OFF\n4 4 6\n{POINTS}{FACES}".replace("\n", "\r"),
    "blank before line end": f"OFF\n4 4 6\n{POINTS}{FACES}".replace("\n", " \n"),
    "no last line end": f"OFF\n4 4 6\n{POINTS}{FACES}".rstrip(),
    "COFF": f"COFF\n4 4 6\n{NORMALS.replace(chr(10), ' 255' + chr(10))}{FACES}",
    "NOFF": f"NOFF\n4 4 6\n{NORMALS}{FACES}",
    "CNOFF": f"CNOFF\n4 4 6\n{NORMALS.replace(chr(10), ' 1 2 3 255' + chr(10))}{FACES}",
    "STOFF": f"STOFF\n4 4 6\n{POINTS.replace(chr(10), ' 0.5 0.5' + chr(10))}{FACES}",
    "face colours": f"OFF\n4 4 6\n{POINTS}{FACES.replace(chr(10), ' 255 0 0' + chr(10))}",
    "colours of some faces": f"OFF\n4 4 6\n{POINTS}{FACES.replace('3 0 1 3', '3 0 1 3 0.1 0.2 0.3')}",
    "colours of some vertices": f"OFF\n4 4 6\n{POINTS.replace('1 0 0', '1 0 0 9 9 9')}{FACES}",
    "trailing data": f"OFF\n4 4 6\n{POINTS}{FACES}2 0 1\nanything\n",
    "exponents": f"OFF\n4 4 6\n{POINTS.replace('1 0 0', '1.0e+00 -0.0 0E0')}{FACES}",
    "byte outside of ASCII in a comment": f"OFF # Caf\xe9\n4 4 6\n{POINTS}{FACES}",
}


@pytest.mark.parametrize("text", VARIANTS.values(), ids=VARIANTS.keys())
def test_every_variant_gives_the_same_mesh(text):
    raw = parse_off(text.encode("latin-1"))
    np.testing.assert_array_equal(raw.vertices, VERTICES)
    np.testing.assert_array_equal(raw.faces, TRIANGLES)
    assert count_off(text.encode("latin-1")) == 4


BROKEN = {
    "binary": (b"OFF BINARY\n\0\0\0\4", "binary OFF"),
    "binary coloured": (b"COFF BINARY\n\0\0\0\4", "binary OFF"),
    "zero bytes": (b"OFF\n4 4 0\n\0\0", "binary or damaged"),
    "4-D": (b"4OFF\n4 4 6\n", "three dimensions"),
    "n-D": (b"nOFF\n5\n4 4 6\n", "three dimensions"),
    "other text": (b"hello world\n", "wanted 'OFF'"),
    "keyword alone": (b"OFF\n", "wanted 'OFF'"),
    "negative count": (b"OFF\n-4 4 6\n", "numbers of vertices"),
    "short face": (f"OFF\n4 1 0\n{POINTS}3 0 1\n".encode(), "face 0.*cut short"),
    "face with words": (f"OFF\n4 1 0\n{POINTS}3 0 1 x\n".encode(), "face 0 is '3 0 1 x'"),
    "face with a fraction": (f"OFF\n4 1 0\n{POINTS}3 0 1 2.5\n".encode(), "face 0 is '3 0 1 2.5'"),
    "short vertex": (b"OFF\n2 0 0\n0 0 0\n1 1\n", "vertex 1 is '1 1'"),
    "vertex with words": (b"OFF\n2 0 0\n0 0 0\n1 1 one\n", "vertex 1 is '1 1 one'"),
    "cut": (f"OFF\n4 4 6\n{POINTS}3 0 1 2\n".encode(), "4 vertices and 4 faces, but only 5 lines"),
    "count too low": (f"OFF\n3 4 0\n{POINTS}{FACES}".encode(), "face 0 is '0 0 1'"),
    "absurd count": (b"OFF\n99999999999999999999 1 0\n0 0 0\n", "cut short"),
}


@pytest.mark.parametrize(("data", "message"), BROKEN.values(), ids=BROKEN.keys())
def test_broken_files_say_what_is_wrong(data, message):
    with pytest.raises(MeshError, match=message):
        parse_off(data)


def test_polygons_are_kept_with_their_corners():
    raw = parse_off(f"OFF\n4 4 0\n{POINTS}3 0 1 2\n4 0 1 2 3 255 0 0\n2 0 1\n3 1 2 3\n".encode())
    assert raw.sizes.tolist() == [3, 4, 2, 3]
    assert raw.corners.tolist() == [0, 1, 2, 0, 1, 2, 3, 0, 1, 1, 2, 3]


def test_lines_after_the_last_face_are_a_note():
    (note,) = parse_off(f"OFF\n4 4 6\n{POINTS}{FACES}2 0 1\nanything\n".encode()).notes
    assert "2 lines follow" in note


WRAPPED = {
    "one number a line": f"OFF\n4 4 6\n{POINTS}{FACES}".replace(" ", "\n"),
    "two vertices a line": f"OFF\n4 4 6\n0 0 0 1 0 0\n0 1 0 0 0 1\n{FACES}",
    "a face over two lines": f"OFF\n4 4 6\n{POINTS}{FACES.replace('3 0 1 3', '3 0' + chr(10) + '1 3')}",
    "no line ends at all": f"OFF\n4 4 6\n{POINTS}{FACES}".replace("\n", " "),
    "no edge count": f"OFF\n4 4\n0 0 0 1 0 0\n0 1 0 0 0 1\n{FACES}",
    "NOFF": f"NOFF\n4 4 6\n{NORMALS}{FACES}".replace("1 0 0\n", "1\n0 0\n"),
}


@pytest.mark.parametrize("text", WRAPPED.values(), ids=WRAPPED.keys())
def test_wrapped_lines_are_read_number_by_number_and_noted(text):
    raw = parse_off(text.encode())
    np.testing.assert_array_equal(raw.vertices, VERTICES)
    np.testing.assert_array_equal(raw.faces, TRIANGLES)
    assert "wrapped" in raw.notes[0]


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_a_byte_order_mark_costs_nothing(encoding):
    raw = parse_off(f"OFF\n4 4 6\n{POINTS}{FACES}".encode(encoding))
    np.testing.assert_array_equal(raw.vertices, VERTICES)
    np.testing.assert_array_equal(raw.faces, TRIANGLES)


def test_colours_make_a_coff_file_that_reads_back():
    mesh = blob(2)
    colors = np.arange(3 * mesh.n_vertices).reshape(-1, 3).astype(np.uint8)
    text = format_off(mesh, colors)
    assert text.startswith(b"COFF\n")
    np.testing.assert_array_equal(parse_off(text).vertices, mesh.vertices)
    columns = np.array([line.split() for line in text.splitlines()[2 : 2 + mesh.n_vertices]], dtype=float)
    np.testing.assert_array_equal(columns[:, 3:6], colors)
