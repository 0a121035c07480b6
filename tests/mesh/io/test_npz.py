import io
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest

from csm.errors import MeshError
from csm.mesh.io import read_mesh
from csm.mesh.io.npz import parse_npz
from tests.shapes import blob

CASES = Path(__file__).parents[2] / "cases"
MESH = blob(1)


def npz(**arrays) -> bytes:
    stream = io.BytesIO()
    np.savez_compressed(stream, **arrays)
    return stream.getvalue()


@pytest.mark.parametrize("kind", [np.int32, np.uint16, np.uint64, float, ">i4"])
@pytest.mark.parametrize("order", ["C", "F"])
def test_faces_of_every_kind_that_are_whole(kind, order):
    raw = parse_npz(npz(vertices=np.asarray(MESH.vertices, order=order), faces=MESH.faces.astype(kind, order=order)))
    np.testing.assert_array_equal(raw.vertices, MESH.vertices)
    np.testing.assert_array_equal(raw.faces, MESH.faces)


REFUSED = {
    "keys": (npz(verts=np.eye(3), faces=np.eye(3)), "wanted the arrays.*found verts, faces"),
    "objects": (npz(vertices=np.array([{}], dtype=object), faces=np.eye(3)), "Python objects"),
    "complex": (npz(vertices=MESH.vertices + 0j, faces=MESH.faces), "imaginary part would be lost"),
    "fractions": (npz(vertices=MESH.vertices, faces=MESH.faces + 0.5), "faces hold .*whole numbers"),
    "nan face": (npz(vertices=MESH.vertices, faces=np.full((1, 3), np.nan)), "faces hold nan"),
    "truth": (npz(vertices=MESH.vertices, faces=np.ones((1, 3), bool)), "truth values"),
    "records": (npz(vertices=np.zeros(3, [("x", "f8")]), faces=MESH.faces), "records"),
    "text": (npz(vertices=np.array(["a"]), faces=MESH.faces), "records of the kind <U1"),
    "pentagons": (npz(vertices=MESH.vertices, faces=np.zeros((2, 5), int)), r"shape \(2, 5\)"),
    "bare npy": (b"\x93NUMPY\x01\x00", "single NumPy array"),
}


@pytest.mark.parametrize(("data", "message"), REFUSED.values(), ids=REFUSED.keys())
def test_what_is_no_mesh_is_refused_with_its_reason(data, message):
    with pytest.raises(MeshError, match=message):
        parse_npz(data)


def test_an_announced_size_is_not_believed():
    """A shape of terabytes in a header, and a member that unpacks to a thousand times the archive."""
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": (10**12, 3)})
    for content, message in ((header.getvalue(), "announces the shape"), (b"\0" * 10, "no NumPy array")):
        stream = io.BytesIO()
        with zipfile.ZipFile(stream, "w") as archive:
            archive.writestr("vertices.npy", content)
            archive.writestr("faces.npy", content)
        with pytest.raises(MeshError, match=message):
            parse_npz(stream.getvalue())
    bomb = bytearray(npz(vertices=np.zeros((10, 3)), faces=MESH.faces))
    at = bomb.find(b"PK\x01\x02")
    bomb[at + 24 : at + 28] = struct.pack("<I", 2**32 - 2)
    with pytest.raises(MeshError, match=r"announces 4294967294 bytes.*more than csm unpacks"):
        parse_npz(bytes(bomb))


def _with_flag(offset: int, value: int) -> bytes:
    data = bytearray(npz(vertices=MESH.vertices, faces=MESH.faces))
    at = data.find(b"PK\x01\x02")
    data[at + offset] = value
    return bytes(data)


def test_encryption_and_unknown_compression_are_said():
    with pytest.raises(MeshError, match="encrypted"):
        parse_npz(_with_flag(8, 1))
    with pytest.raises(MeshError, match="method 98"):
        parse_npz(_with_flag(10, 98))


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("bare_npy_inside", "'faces' is no NumPy array"),
        ("odd_array", "'vertices' is no NumPy array"),
        ("z_rec", "'vertices' holds records"),
        ("z_raw", "'vertices' is no NumPy array"),
    ],
)
def test_damaged_archives_give_one_sentence(name, message):
    path = CASES / "damaged" / f"{name}.npz"
    with pytest.raises(MeshError, match=rf"{name}\.npz: {message}") as caught:
        read_mesh(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)
