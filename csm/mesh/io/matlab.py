"""MATLAB .mat files: shapes and label vectors, up to v7 through scipy and v7.3 (HDF5) through h5py."""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping
from typing import Any, cast

import h5py
import numpy as np
import scipy.io
from numpy.typing import NDArray

from csm._types import FloatArray
from csm.errors import MeshError
from csm.mesh.io.raw import RawMesh

_HDF5 = b"\x89HDF\r\n\x1a\n"


def parse_mat(data: bytes, choose: object = None) -> RawMesh:
    """Read the one shape of a .mat file: `TRIV` with `X`, `Y`, `Z` or with `VERT`, at the top or in structs.

    The struct's name plays no part (`shape`, `surface`, `S.surface`, `M` are in use).  `TRIV` is 1-based by MATLAB's
    convention; one that holds a 0 cannot be and is taken as 0-based.

    Raises
    ------
    MeshError
        If there is no shape or there are several, or lengths differ.
    """
    found = dict(_shapes(load_mat(data)))
    if len(found) != 1:
        names = ", ".join(found) or "none"
        raise MeshError(f"wanted one shape (TRIV with X, Y, Z or with VERT), found {len(found)} ({names})")
    ((name, fields),) = found.items()
    faces = np.asarray(fields["TRIV"]).reshape(-1, 3)
    if not np.array_equal(faces, faces.astype(np.int64)):
        raise MeshError(f"{name}.TRIV holds numbers that are not whole")
    faces = faces.astype(np.int64)
    base = 0 if (faces == 0).any() else 1
    return RawMesh.of(_vertices(name, fields), faces - base)


def load_mat(data: bytes) -> dict[str, Any]:
    """Return the variables of a .mat file of any version; structs become dictionaries, arrays are as MATLAB has them.

    Raises
    ------
    MeshError
        If the file is no .mat file or is damaged.
    """
    try:
        # MATLAB puts a header of 512 bytes before the HDF5 data.
        if data.startswith(_HDF5) or data[512:520] == _HDF5:
            with h5py.File(io.BytesIO(data), "r") as file:
                return _hdf5_tree(file)
        variables: dict[str, Any] = scipy.io.loadmat(cast(Any, io.BytesIO(data)), simplify_cells=True)
    except Exception as error:
        raise MeshError(f"this is no MATLAB file or it is damaged ({error})") from error
    return {key: value for key, value in variables.items() if not key.startswith("__")}


def _hdf5_tree(group: h5py.Group) -> dict[str, Any]:
    """Return groups as dictionaries and numeric data sets as arrays, transposed: MATLAB is column-major."""
    tree: dict[str, Any] = {}
    for key, item in group.items():
        if isinstance(item, h5py.Group):
            if not key.startswith("#"):
                tree[key] = _hdf5_tree(item)
        elif item.dtype.kind in "iuf":
            tree[key] = np.asarray(item[()]).T
    return tree


def _shapes(tree: Mapping[str, Any], name: str = "") -> Iterator[tuple[str, Mapping[str, Any]]]:
    if "TRIV" in tree and ("VERT" in tree or {"X", "Y", "Z"} <= set(tree)):
        yield name or "the file", tree
        return
    for key, value in tree.items():
        if isinstance(value, Mapping):
            yield from _shapes(value, f"{name}.{key}" if name else key)


def _vertices(name: str, fields: Mapping[str, Any]) -> FloatArray:
    if "VERT" in fields:
        return np.asarray(fields["VERT"], dtype=np.float64).reshape(-1, 3)
    x, y, z = (np.asarray(fields[key], dtype=np.float64).ravel() for key in "XYZ")
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
    arrays = {k: np.asarray(v) for k, v in load_mat(data).items() if np.asarray(v).dtype.kind in "iuf"}
    if "labels" in arrays:
        return arrays["labels"].ravel()
    if len(arrays) != 1:
        raise MeshError(f"wanted a variable 'labels' or a single one, found {', '.join(arrays) or 'none'}")
    return next(iter(arrays.values())).ravel()
