import struct
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

from csm.errors import MeshError
from csm.mesh.io import read_mesh
from csm.mesh.io.stl import parse_stl
from tests.shapes import blob

MESH = blob(1)
CASES = Path(__file__).parents[2] / "cases"


def exported(kind: str = "stl") -> bytes:
    data = trimesh.Trimesh(MESH.vertices, MESH.faces, process=False).export(file_type=kind)
    return data if isinstance(data, bytes) else data.encode()


BINARY, ASCII = exported(), exported("stl_ascii")


def same(raw) -> None:
    assert raw.vertices.shape == (3 * MESH.n_faces, 3)
    np.testing.assert_allclose(raw.vertices[raw.faces], MESH.corners, rtol=1e-5, atol=1e-7)


VARIANTS = {
    "binary": BINARY,
    "ascii": ASCII,
    "binary that begins with solid": b"solid of a program".ljust(80) + BINARY[80:],
    "binary with a facet in its head": b"solid facet normal 0 0 1".ljust(80, b"\0") + BINARY[80:],
    "Latin-1 name": ASCII.replace(b"solid", b"solid Geh\xe4use", 1),
    "a name with a key word": ASCII.replace(b"solid", b"solid a vertex 1", 1),
    "capitals": ASCII.upper().replace(b"E-", b"e-"),
    "byte-order mark": b"\xef\xbb\xbf" + ASCII,
    "UTF-16": ASCII.decode().encode("utf-16"),
    "windows": ASCII.replace(b"\n", b"\r\n"),
    "indented after blank lines": b"\n\n  " + ASCII.replace(b"vertex", b"\t vertex"),
}


@pytest.mark.parametrize("data", VARIANTS.values(), ids=VARIANTS.keys())
def test_triangles_stay_apart_and_in_order(data):
    raw = parse_stl(data)
    same(raw)
    assert raw.notes == ()


def test_bytes_after_the_last_triangle_are_a_note():
    for rest in (b"\r\n", bytes(100), b"x" * 99):
        raw = parse_stl(BINARY + rest)
        same(raw)
        assert raw.notes == (f"{len(rest)} bytes follow the last triangle; they were not read",)


@pytest.mark.parametrize("announced", [0, 1, 79])
def test_a_count_that_is_too_low_is_a_note(announced):
    raw = parse_stl(BINARY[:80] + struct.pack("<I", announced) + BINARY[84:])
    same(raw)
    assert raw.notes == (f"the head announces {announced} triangles, but 80 are there; all of them were read",)


@pytest.mark.filterwarnings("error")
def test_a_signalling_nan_is_a_nan_without_a_warning(tmp_path):
    (tmp_path / "a.stl").write_bytes(BINARY[:96] + bytes.fromhex("010080ff") * 9 + BINARY[132:])
    mesh = read_mesh(tmp_path / "a.stl")
    assert np.isnan(mesh.vertices[:3]).all()
    assert np.isfinite(mesh.vertices[3:]).all()


def test_a_binary_file_that_is_cut_says_so():
    with pytest.raises(MeshError, match="announces 80 triangles, but only 79 are there: the file is cut short"):
        parse_stl(BINARY[:-1])
    with pytest.raises(MeshError, match="announces 4294967295 triangles, but only 80"):
        parse_stl(BINARY[:80] + b"\xff" * 4 + BINARY[84:])
    with pytest.raises(MeshError, match="no STL file, or it is cut short"):
        parse_stl(BINARY[:83])


def test_an_ascii_file_that_is_cut_says_so():
    end = ASCII.rindex(b"vertex")
    with pytest.raises(MeshError, match="ends in the middle of triangle 79: it was cut short"):
        parse_stl(ASCII[:end])
    raw = parse_stl(ASCII[: ASCII.rindex(b"endsolid")])
    same(raw)
    assert "no end" in raw.notes[0]
    with pytest.raises(MeshError, match="vertex 1 is '1 x 2', wanted three numbers"):
        parse_stl(b"solid a\nfacet\nvertex 0 0 0\nvertex 1 x 2\nvertex 1 1 1\nendfacet\nendsolid")
    with pytest.raises(MeshError, match="triangle 0 has 2 corners"):
        parse_stl(b"solid a\nfacet\nvertex 0 0 0\nvertex 1 1 2\nendfacet\nfacet\nendsolid")


def test_several_solids_are_joined_in_the_order_of_the_file_with_a_note():
    other = ASCII.replace(b"solid", b"solid b", 1)
    raw = parse_stl(ASCII + b"\n" + other)
    np.testing.assert_array_equal(raw.vertices, np.tile(parse_stl(ASCII).vertices, (2, 1)))
    assert raw.notes == ("it holds 2 solids; they were joined in the file's order",)


@pytest.mark.parametrize("data", [b"\0" * 84, b"solid a\nendsolid a\n"])
def test_an_empty_file_of_the_format_is_refused(data):
    with pytest.raises(MeshError, match="empty or damaged"):
        parse_stl(data)


def test_no_optional_module_is_needed(monkeypatch):
    monkeypatch.setitem(sys.modules, "charset_normalizer", None)
    monkeypatch.setitem(sys.modules, "chardet", None)
    mesh = read_mesh(CASES / "ascii_latin1_name.stl")
    assert mesh.n_vertices == 3 * mesh.n_faces == 150


def test_the_cases_hold_the_same_triangles():
    whole, trailing = read_mesh(CASES / "binary.stl"), read_mesh(CASES / "binary_trailing.stl")
    np.testing.assert_array_equal(whole.vertices, trailing.vertices)
    assert whole.n_faces == 1280
    assert trailing.notes == ("13 bytes follow the last triangle; they were not read",)
