"""Shapes and label vectors in MATLAB .mat files of all versions; the formats themselves are in two other modules."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from csm._types import FloatArray, IntArray
from csm.errors import MeshError
from csm.mesh.io.choice import Choice, chosen, joined
from csm.mesh.io.matlab5 import Value, is_level_4, is_level_5, read_level_4, read_level_5
from csm.mesh.io.matlab73 import is_hdf5, read_hdf5
from csm.mesh.io.raw import RawMesh
from csm.mesh.shape import real_numbers, whole_numbers

_FACES = ("triv", "faces", "tri", "tris", "triangles", "face", "f")
_POINTS = ("vert", "vertices", "verts", "vertex", "points", "pts", "v")
_SURE = ("triv", "vert")
"""Names that mean a mesh whatever they hold; the others only if their arrays look like one's."""


def load_mat(data: bytes) -> dict[str, Value]:
    """Return the variables of a .mat file of any version, see `Value`; what holds no numbers is None.

    Raises
    ------
    MeshError
        If the file is no .mat file or is damaged.
    """
    if is_hdf5(data):
        return read_hdf5(data)
    if is_level_5(data):
        return read_level_5(data)
    if is_level_4(data):
        return read_level_4(data)
    raise MeshError("this is no MATLAB file or its head is damaged")


def parse_mat(data: bytes, choose: Choice = None) -> RawMesh:
    """Read a shape of a .mat file: faces with vertices, at the top, in structs or in cells.

    The struct's name plays no part (`shape`, `surface`, `S.surface`, `M` are in use), nor does the case of letters.
    Faces are called `TRIV` (or faces, tri, F and the like), vertices `VERT` (or vertices, V and the like), `X`, `Y`
    and `Z`, or `X` alone with three columns.  Arrays may lie on their side: the axis of length 3 tells.  Faces of four
    columns are quads, those filled up with NaN are polygons.  They are 1-based by MATLAB's convention; faces that hold
    a 0 cannot be and are taken as 0-based.

    Raises
    ------
    MeshError
        If there is no shape, there are several and none is chosen, or arrays do not fit each other or can be read in
        two ways.
    """
    found = list(_shapes(load_mat(data)))
    if not found:
        raise MeshError("wanted a shape (TRIV with X, Y, Z or with VERT, or faces with vertices), found none")
    picked = chosen([name for name, _ in found], choose)
    return joined([_shape(*found[i]) for i in picked])


def _shapes(value: Value, name: str = "") -> Iterator[tuple[str, dict[str, NDArray[Any]]]]:
    """Yield the name and the arrays "faces" and "points" or "x", "y", "z" of every shape."""
    if isinstance(value, dict):
        fields = _mesh_fields(value)
        if fields is not None:
            yield name or "the file", fields
            return
        for key, item in value.items():
            yield from _shapes(item, f"{name}.{key}" if name else key)
    elif isinstance(value, list):
        for i, item in enumerate(value):
            yield from _shapes(item, f"{name}[{i}]")


def _mesh_fields(struct: Mapping[str, Value]) -> dict[str, NDArray[Any]] | None:
    arrays = {key.lower(): value for key, value in reversed(list(struct.items())) if isinstance(value, np.ndarray)}
    faces = next((arrays[k] for k in _FACES if k in arrays and (k in _SURE or _looks(arrays[k], 3, 4))), None)
    if faces is None:
        return None
    points = next((arrays[k] for k in _POINTS if k in arrays and (k in _SURE or _looks(arrays[k], 3))), None)
    if points is not None:
        return {"faces": faces, "points": points}
    if {"x", "y", "z"} <= arrays.keys():
        return {"faces": faces, **{key: arrays[key] for key in "xyz"}}
    if "x" in arrays and _looks(arrays["x"], 3):
        return {"faces": faces, "points": arrays["x"]}
    return None


def _looks(array: NDArray[Any], *lengths: int) -> bool:
    return array.ndim == 2 and any(n in lengths for n in array.shape)


def _shape(name: str, fields: Mapping[str, NDArray[Any]]) -> RawMesh:
    faces = fields["faces"]
    points = fields.get("points")
    by_rows = _points_by_rows(name, fields)
    if points is not None and by_rows is None and faces.ndim == 2 and not _either_way(faces.shape):
        by_rows = _by_rows(faces.shape)
    if points is not None and by_rows is None:
        raise MeshError(
            f"{name}: the vertices are 3 x 3 and the faces {_size(faces)}, so nothing tells rows from columns; store "
            "vertices as N x 3 and faces as M x 3 together with at least one more vertex"
        )
    corners, sizes, turned = _faces(name, faces, by_rows)
    if points is None:
        vertices = _from_coordinates(name, fields)
    else:
        vertices = real_numbers(points if by_rows else points.T, f"{name}: vertices")
    notes = [f"{name}: the faces are stored as {_size(faces)} and were read as the transpose"] if turned else []
    if points is not None and not by_rows:
        notes.append(f"{name}: the vertices are stored as {_size(points)} and were read as the transpose")
    return RawMesh(vertices, corners - (0 if (corners == 0).any() else 1), sizes, tuple(notes))


def _size(array: NDArray[Any]) -> str:
    return " x ".join(map(str, array.shape))


def _points_by_rows(name: str, fields: Mapping[str, NDArray[Any]]) -> bool | None:
    """Tell whether each vertex is a row; None if either is possible."""
    points = fields.get("points")
    if points is None:
        return True if all(fields[k].ndim == 2 and fields[k].shape[1] == 1 < len(fields[k]) for k in "xyz") else None
    if not _looks(points, 3):
        raise MeshError(f"{name}: the vertices are {_size(points)}, wanted N x 3")
    return None if points.shape == (3, 3) else points.shape[1] == 3


def _either_way(shape: tuple[int, ...]) -> bool:
    """Tell whether faces of this shape may be triangles or quads in rows as well as in columns."""
    return set(shape) <= {3, 4}


def _by_rows(shape: tuple[int, ...]) -> bool:
    """Tell whether each face is a row; triangles go before quads, and wider faces lie in rows only."""
    return shape[1] == 3 or (shape[0] != 3 and (shape[1] == 4 or shape[0] != 4))


def _faces(name: str, faces: NDArray[Any], points_by_rows: bool | None) -> tuple[IntArray, IntArray, bool]:
    """Return the corners, their numbers per face, and whether the array was turned."""
    if faces.size == 0:
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64), False
    if faces.ndim != 2:
        raise MeshError(f"{name}: the faces are {_size(faces)}, wanted M x 3")
    if faces.dtype.kind == "f" and faces.shape[1] > 3 and np.isnan(faces).any():
        return *_filled_up(name, faces), False
    by_rows = _by_rows(faces.shape)
    if _either_way(faces.shape):
        if points_by_rows is None or (faces.shape[0] != faces.shape[1] and points_by_rows != by_rows):
            raise MeshError(
                f"{name}: the faces are {_size(faces)}, which is possible both in rows and in columns; store them as "
                "M x 3 beside vertices as N x 3"
            )
        by_rows = points_by_rows
    rows = faces if by_rows else faces.T
    if rows.shape[1] not in (3, 4):
        raise MeshError(f"{name}: the faces are {_size(faces)}, wanted M x 3 (triangles) or M x 4 (quads)")
    corners = whole_numbers(rows, f"{name}: faces")
    return corners.ravel(), np.full(len(rows), rows.shape[1], dtype=np.int64), not by_rows


def _filled_up(name: str, rows: NDArray[Any]) -> tuple[IntArray, IntArray]:
    """Return the corners of polygons whose rows are filled up with NaN, as MATLAB's `patch` has them."""
    filled = ~np.isnan(rows)
    if (filled[:, 1:] & ~filled[:, :-1]).any():
        raise MeshError(f"{name}: a face has a NaN between its corners")
    return whole_numbers(rows[filled], f"{name}: faces"), filled.sum(axis=1, dtype=np.int64)


def _from_coordinates(name: str, fields: Mapping[str, NDArray[Any]]) -> FloatArray:
    x, y, z = (real_numbers(fields[key], f"{name}: {key.upper()}").ravel(order="F") for key in "xyz")
    if not len(x) == len(y) == len(z):
        raise MeshError(f"{name}: X, Y and Z have {len(x)}, {len(y)} and {len(z)} entries, wanted equal numbers")
    return np.stack([x, y, z], axis=1)


def label_vector(data: bytes) -> NDArray[Any]:
    """Return the vector `labels` of a .mat file, or its only numeric variable, flattened.

    Raises
    ------
    MeshError
        If there is no such variable or the choice is not clear.
    """
    arrays = {k: v for k, v in load_mat(data).items() if isinstance(v, np.ndarray) and v.dtype.kind in "iuf"}
    if "labels" in arrays:
        return arrays["labels"].ravel()
    if len(arrays) != 1:
        raise MeshError(f"wanted a variable 'labels' or a single one, found {', '.join(arrays)[:200] or 'none'}")
    return next(iter(arrays.values())).ravel()
