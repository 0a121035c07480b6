"""Meshes in NumPy archives: the arrays `vertices` and `faces`, read with every size checked beforehand."""

from __future__ import annotations

import io
import math
import warnings
import zipfile
from typing import Any

import numpy as np
from numpy.typing import NDArray

from csm.errors import MeshError
from csm.mesh.io.guard import most_unpacked
from csm.mesh.io.raw import RawMesh
from csm.mesh.shape import real_numbers, whole_numbers

_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA)


def parse_npz(data: bytes) -> RawMesh:
    """Read the arrays `vertices` (N, 3) and `faces` (M, 3) or (M, 4), 0-based, of a NumPy archive.

    Pickles are refused.  Faces may be stored as floating-point numbers as long as these are whole.

    Raises
    ------
    MeshError
        If it is no such archive, is encrypted, damaged or larger than it may be, or an array is of a wrong kind.
    """
    if data.startswith(b"\x93NUMPY"):
        raise MeshError("this is a single NumPy array (.npy), wanted an archive with 'vertices' and 'faces'")
    if not data.startswith(b"PK"):
        raise MeshError("this is no NumPy archive")
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = {info.filename: info for info in archive.infolist()}
        names = [name.removesuffix(".npy") for name in members]
        if not {"vertices", "faces"} <= set(names):
            raise MeshError(f"wanted the arrays 'vertices' and 'faces', found {', '.join(names)[:200] or 'none'}")
        vertices, faces = (_member(archive, members, name) for name in ("vertices", "faces"))
    points, corners = real_numbers(vertices, "vertices"), whole_numbers(faces, "faces")
    if corners.ndim != 2 or corners.shape[1] not in (3, 4):
        raise MeshError(f"faces have shape {corners.shape}, wanted (M, 3)")
    return RawMesh.of(points, corners)


def _member(archive: zipfile.ZipFile, members: dict[str, zipfile.ZipInfo], name: str) -> NDArray[Any]:
    info = members.get(f"{name}.npy") or members[name]
    if info.flag_bits & 1:
        raise MeshError(f"'{name}' is encrypted; csm reads plain archives only")
    if info.compress_type not in _METHODS:
        raise MeshError(f"'{name}' is compressed with method {info.compress_type}, which csm does not know")
    if info.file_size > most_unpacked(info.compress_size):
        raise MeshError(
            f"'{name}' announces {info.file_size} bytes, packed into {info.compress_size}: more than csm unpacks"
        )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of NumPy, on archives that Python 2 wrote
        return _array(archive.read(info), name)


def _array(data: bytes, name: str) -> NDArray[Any]:
    """Read one array in NumPy's own format, without pickles and without trusting the size that it announces."""
    stream = io.BytesIO(data)
    try:
        version = np.lib.format.read_magic(stream)
        read = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}[version]
        shape, fortran, dtype = read(stream)
    except (ValueError, KeyError) as error:
        raise MeshError(f"'{name}' is no NumPy array ({str(error)[:100]})") from None
    if dtype.hasobject:
        raise MeshError(f"'{name}' holds Python objects, wanted numbers")
    if dtype.kind not in "iufcb" or dtype.names is not None:
        raise MeshError(f"'{name}' holds records of the kind {dtype}, wanted plain numbers")
    start, count = stream.tell(), math.prod(shape)
    if any(n < 0 for n in shape) or count * dtype.itemsize > len(data) - start:
        raise MeshError(f"'{name}' announces the shape {shape}, but holds {len(data) - start} bytes: it is damaged")
    flat = np.frombuffer(data, dtype, count, start)
    return flat.reshape(shape, order="F" if fortran else "C")
