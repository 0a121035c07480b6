from pathlib import Path

import numpy as np
import pytest

from csm.errors import MeshError
from csm.mesh.io import read_mesh
from csm.mesh.io.vtk import parse_vtk
from tests.shapes import blob

MESH = blob(1)
CASES = Path(__file__).parents[2] / "cases"
N, M = MESH.n_vertices, MESH.n_faces


def file(*parts, binary: bool, version: str = "3.0") -> bytes:
    """Join words and (type, array) pairs; arrays are binary, on a line of their own, or words."""
    data = f"# vtk DataFile Version {version}\na title # with anything\n{'BINARY' if binary else 'ASCII'}\n".encode()
    for part in parts:
        if isinstance(part, str):
            data += part.encode() + b"\n"
        elif binary:
            data += np.asarray(part[1]).astype(part[0]).tobytes() + b"\n"
        else:
            data += "\n".join(map(repr, np.asarray(part[1]).ravel().tolist())).encode() + b"\n"
    return data


def table(polygons) -> tuple[str, list[int]]:
    return ">i4", [number for polygon in polygons for number in (len(polygon), *polygon)]


POINTS = (f"POINTS {N} double", (">f8", MESH.vertices))
FACES = MESH.faces.tolist()
FIELD = ("FIELD FieldData 2", "TIME 1 1 double", (">f8", [0.5]), "CYCLE 2 1 int", (">i4", [3, 4]))
DATA = ("POINT_DATA 42", "SCALARS x float 1", "LOOKUP_TABLE default", (">f4", np.zeros(42)))
POLYGONS = (f"POLYGONS {M} {4 * M}", table(FACES))
OFFSETS = (
    f"POLYGONS {M + 1} {3 * M}",
    "OFFSETS vtktypeint64",
    (">i8", np.arange(M + 1) * 3),
    "CONNECTIVITY vtktypeint64",
    (">i8", MESH.faces),
)
META = ("METADATA", "INFORMATION 1", "NAME L2 LOCATION vtk", "DATA 2 0 1", "")
CELLS = (f"CELLS {M} {4 * M}", table(FACES), f"CELL_TYPES {M}", (">i4", np.full(M, 5)))
VARIANTS = {
    "polydata": ("DATASET POLYDATA", *POINTS, *POLYGONS),
    "with data": ("DATASET POLYDATA", *FIELD, *POINTS, *POLYGONS, *DATA),
    "lines as well": ("DATASET POLYDATA", *POINTS, "LINES 1 3", table([[0, 1]]), *POLYGONS),
    "version 5.1": ("DATASET POLYDATA", *POINTS, *META, *OFFSETS),
    "grid": ("DATASET UNSTRUCTURED_GRID", *POINTS, *CELLS),
}


@pytest.mark.parametrize("binary", [False, True])
@pytest.mark.parametrize("parts", VARIANTS.values(), ids=VARIANTS.keys())
def test_every_variant_gives_the_same_mesh(parts, binary):
    raw = parse_vtk(file(*parts, binary=binary))
    np.testing.assert_array_equal(raw.vertices, MESH.vertices)
    np.testing.assert_array_equal(raw.faces, MESH.faces)


def test_windows_line_ends_in_text():
    raw = parse_vtk(file(*VARIANTS["with data"], binary=False).replace(b"\n", b"\r\n"))
    np.testing.assert_array_equal(raw.faces, MESH.faces)


def test_the_case_is_the_mesh_of_the_others():
    mesh, reference = read_mesh(CASES / "legacy.vtk"), read_mesh(CASES / "plain.off.gz")
    np.testing.assert_array_equal(mesh.vertices, reference.vertices)
    np.testing.assert_array_equal(mesh.faces, reference.faces)


@pytest.mark.parametrize("binary", [False, True])
def test_cells_of_every_flat_kind(binary):
    cells = [[0, 1, 2], [0, 1, 2, 3], [4, 5, 6, 7], [0, 1, 2, 3, 4], [8, 9], [0, 1, 2, 3]]
    size = sum(map(len, cells)) + len(cells)
    parts = (f"CELLS {len(cells)} {size}", table(cells), f"CELL_TYPES {len(cells)}", (">i4", [5, 9, 8, 7, 3, 6]))
    raw = parse_vtk(file("DATASET UNSTRUCTURED_GRID", *POINTS, *parts, binary=binary))
    assert raw.sizes.tolist() == [3, 4, 4, 5, 3, 3]
    assert raw.corners.tolist() == [0, 1, 2, 0, 1, 2, 3, 4, 5, 7, 6, 0, 1, 2, 3, 4, 0, 1, 2, 2, 1, 3]
    assert raw.notes == ("1 point or line was skipped", "2 triangles were taken from 1 triangle strip")


WRONG_OFFSETS = (*OFFSETS[:2], (">i8", np.zeros(M + 1)), *OFFSETS[3:])
REFUSED = {
    "xml": (b'<?xml version="1.0"?><VTKFile type="PolyData">', "xml format, which csm does not read"),
    "other": (b"OFF\n1 1 1", "no legacy VTK file"),
    "image": (file("DATASET STRUCTURED_POINTS", binary=False), "holds a STRUCTURED_POINTS"),
    "volume": (
        file("DATASET UNSTRUCTURED_GRID", *POINTS, "CELLS 1 5", table([[0, 1, 2, 3]]), "CELL_TYPES 1 10", binary=False),
        "cells of type 10, which are no polygons",
    ),
    "no types": (file("DATASET UNSTRUCTURED_GRID", *POINTS, *CELLS[:2], binary=True), "not as many CELL_TYPES"),
    "huge": (file("DATASET POLYDATA", "POINTS 900000000000 float", binary=False), "announces 2700000000000 numbers"),
    "word": (file("DATASET POLYDATA", "POINTS 1 float", "0 x 0", binary=False), "something else"),
    "type": (file("DATASET POLYDATA", "POINTS 1 real", "0 0 0", binary=False), "type 'real'"),
    "sizes": (file("DATASET POLYDATA", *POINTS, "POLYGONS 2 4", table([[0, 1, 2]]), binary=True), "announce 2 cells"),
    "offsets": (
        file("DATASET POLYDATA", *POINTS, *OFFSETS[:2], (">i8", np.zeros(M + 1)), *OFFSETS[3:], binary=True),
        "fit",
    ),
    "nothing": (file(binary=True), "names no DATASET"),
    "no points": (file("DATASET POLYDATA", binary=True), "has no POINTS"),
}


@pytest.mark.parametrize(("data", "message"), REFUSED.values(), ids=REFUSED.keys())
def test_what_cannot_be_read_is_one_sentence(data, message):
    with pytest.raises(MeshError, match=message):
        parse_vtk(data)


@pytest.mark.parametrize("binary", [False, True])
def test_a_cut_before_the_last_number_is_an_error_or_leaves_the_faces_out(binary):
    data = file(*VARIANTS["polydata"], binary=binary)
    for end in range(60, len(data) - 8, 61):
        try:
            raw = parse_vtk(data[:end])
        except MeshError:
            continue
        assert len(raw.vertices) == N
        assert len(raw.sizes) == 0
