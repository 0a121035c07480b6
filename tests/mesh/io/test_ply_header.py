import numpy as np
import pytest

from csm.errors import MeshError
from csm.mesh.io.ply import counts_ply, parse_ply
from tests.mesh.io.plyfiles import FACES, FORMS, MESH, XYZ, V, made

ODD_HEADS = {
    "comment with the end": "comment end_header\n",
    "comment before": "comment  end_header \nobj_info end_header x\n",
    "blank line": "\n",
}


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("head", ODD_HEADS.values(), ids=ODD_HEADS.keys())
def test_the_header_ends_at_its_own_line(head, form):
    data = made(form, {"vertex": XYZ, "face": [("list uchar int vertex_indices", FACES)]}, head)
    np.testing.assert_array_equal(parse_ply(data).vertices, MESH.vertices)
    assert counts_ply(data) == (MESH.n_vertices, MESH.n_faces)


@pytest.mark.parametrize("end", [b"\r\n", b"\r"])
@pytest.mark.parametrize("form", FORMS)
def test_lines_may_end_in_any_way(form, end):
    data = made(form, {"vertex": XYZ, "face": [("list uchar int vertex_indices", FACES)]})
    head, _, body = data.partition(b"end_header\n")
    head = (head + b"end_header\n").replace(b"\n", end)
    body = body.replace(b"\n", end) if form == "ascii" else body
    np.testing.assert_array_equal(parse_ply(b"\xef\xbb\xbf" + head + body).vertices, MESH.vertices)


HEADERS = {
    "no format": (f"ply\nelement vertex 0\n{V}end_header\n", "names no format"),
    "format": (f"ply\nformat binary 1.0\nelement vertex 0\n{V}end_header\n", "line 'format binary 1.0', which makes"),
    "count": (f"ply\nformat ascii 1.0\nelement vertex -1\n{V}end_header\n", "line 'element vertex -1'"),
    "type": ("ply\nformat ascii 1.0\nelement vertex 0\nproperty real x\nend_header\n", "line 'property real x'"),
    "before": ("ply\nformat ascii 1.0\nproperty float x\nend_header\n", "line 'property float x'"),
    "float length": ("ply\nformat ascii 1.0\nelement a 0\nproperty list float int x\nend_header\n", "list float int"),
    "two axes": ("ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nend_header\n", "no coordinate y and z"),
    "no end": (f"ply\nformat ascii 1.0\nelement vertex 0\n{V}", "wanted a PLY header"),
    "other lists": (
        f"ply\nformat ascii 1.0\nelement vertex 0\n{V}element face 0\nproperty int a\nproperty int b\nend_header\n",
        "no list 'vertex_indices', but a, b",
    ),
}


@pytest.mark.parametrize(("data", "message"), HEADERS.values(), ids=HEADERS.keys())
def test_headers_that_make_no_sense(data, message):
    with pytest.raises(MeshError, match=message):
        parse_ply(data.encode())
