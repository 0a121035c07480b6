"""The STL format: separate triangles that share no vertices."""

from __future__ import annotations

import io

import numpy as np
from trimesh.exchange.stl import load_stl

from csm.errors import MeshError
from csm.mesh.io.raw import RawMesh


def parse_stl(data: bytes) -> RawMesh:
    """Read an STL file, ASCII or binary, as it is: three vertices of its own for each of the M triangles, N = 3 M.

    Nothing is merged, so the surface is not connected and `csm check` reports duplicate vertices and M components.

    Raises
    ------
    MeshError
        If there is no triangle or the file is damaged.
    """
    loaded = load_stl(io.BytesIO(data))
    solids = loaded.get("geometry", {"": loaded})
    if len(solids) != 1:
        raise MeshError(f"the file holds {len(solids)} solids, wanted one; is it empty or damaged, or an assembly?")
    (loaded,) = solids.values()
    vertices, faces = np.asarray(loaded["vertices"]), np.asarray(loaded["faces"])
    if len(faces) == 0 or len(vertices) != 3 * len(faces):
        raise MeshError(f"found {len(vertices)} corners of {len(faces)} triangles: an empty or damaged STL file")
    return RawMesh.of(vertices, faces)
