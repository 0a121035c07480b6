"""The PLY format, ASCII and binary of both byte orders: http://paulbourke.net/dataformats/ply, Turk's description."""

from __future__ import annotations

import codecs

import numpy as np
from numpy.typing import NDArray

from csm._counts import counted
from csm.errors import MeshError
from csm.mesh.io.ply_header import read_header
from csm.mesh.io.ply_rows import Column, read_elements
from csm.mesh.io.raw import RawMesh, strip_triangles
from csm.mesh.shape import Mesh, whole_numbers


def parse_ply(data: bytes) -> RawMesh:
    """Read the vertices, faces and triangle strips of a PLY file; other elements and properties are skipped.

    Faces may have any number of corners, and lists any length.  Strips become triangles, behind the faces, each turned
    as the strip has it.

    Raises
    ------
    MeshError
        If the header is damaged, an element is cut short, or a row does not have the numbers that it should.
    """
    data = data.removeprefix(codecs.BOM_UTF8)
    tables, note = read_elements(data, read_header(data), ("vertex", "face", "tristrips"))
    notes = [note] if note else []
    vertex = _table(tables, "vertex")
    missing = [axis for axis in "xyz" if axis not in vertex or (vertex[axis].sizes != 1).any()]
    if missing:
        raise MeshError(f"the vertices have no coordinate {' and '.join(missing)}")
    points = np.stack([vertex[axis].values.astype(np.float64) for axis in "xyz"], axis=1)
    corners, sizes = np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    if "face" in tables:
        column = _indices(tables["face"], "face")
        corners, sizes = whole_numbers(column.values, "faces"), column.sizes
    if "tristrips" in tables:
        column = _indices(tables["tristrips"], "tristrips")
        triangles, left_out = strip_triangles(whole_numbers(column.values, "strips"), column.sizes)
        notes.append(
            f"{counted(len(triangles), 'triangle was', 'triangles were')} taken from "
            f"{counted(len(column.sizes), 'triangle strip')}"
        )
        if left_out:
            notes[-1] += f"; {left_out} that name a vertex twice only join strips and were left out"
        corners = np.concatenate([corners, triangles.ravel()])
        sizes = np.concatenate([sizes, np.full(len(triangles), 3)])
    return RawMesh(points, corners, sizes, tuple(notes))


def _table(tables: dict[str, dict[str, Column]], name: str) -> dict[str, Column]:
    if name not in tables:
        raise MeshError(f"the PLY header names no element '{name}'")
    return tables[name]


def _indices(columns: dict[str, Column], element: str) -> Column:
    for name in ("vertex_indices", "vertex_index"):
        if name in columns:
            return columns[name]
    if len(columns) == 1:
        return next(iter(columns.values()))
    raise MeshError(
        f"the element '{element}' has no list 'vertex_indices', but {', '.join(columns)[:100] or 'nothing'}"
    )


def counts_ply(data: bytes) -> tuple[int, int]:
    """Return the numbers of vertices and faces that the header announces.

    Raises
    ------
    MeshError
        If the header is damaged or names no vertices.
    """
    counts = {e.name: e.count for e in read_header(data.removeprefix(codecs.BOM_UTF8)).elements}
    if "vertex" not in counts:
        raise MeshError("the PLY header names no element 'vertex'")
    return counts["vertex"], counts.get("face", 0)


def format_ply(mesh: Mesh, colors: NDArray[np.uint8] | None = None) -> bytes:
    """Write binary little-endian PLY with float64 coordinates and, if given, colours (N, 3) per vertex."""
    fields = [("x", "<f8"), ("y", "<f8"), ("z", "<f8")]
    names = ["property double x", "property double y", "property double z"]
    if colors is not None:
        fields += [("red", "u1"), ("green", "u1"), ("blue", "u1")]
        names += ["property uchar red", "property uchar green", "property uchar blue"]
    points = np.empty(mesh.n_vertices, dtype=fields)
    columns = [*mesh.vertices.T, *(colors.T if colors is not None else ())]
    for (key, _), column in zip(fields, columns, strict=True):
        points[key] = column
    faces = np.empty(mesh.n_faces, dtype=[("n", "u1"), ("corners", "<i4", 3)])
    faces["n"], faces["corners"] = 3, mesh.faces
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {mesh.n_vertices}", *names]
    head += [f"element face {mesh.n_faces}", "property list uchar int vertex_indices", "end_header", ""]
    return "\n".join(head).encode("ascii") + points.tobytes() + faces.tobytes()
