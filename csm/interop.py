"""Meshes to and from the objects of other libraries.

Nothing of theirs is imported before a function needs it.  Vertices and faces keep their order and number; what else an
object holds (colours, normals, texture coordinates) stays behind.  `csm.match` and all other functions that take a mesh
take objects of trimesh and pairs of arrays as they are.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from csm._types import IntArray
from csm.errors import ConfigError, MeshError
from csm.mesh.shape import Mesh

_INSTALL = {"torch_geometric": "torch-geometric", "pyFM": "pyfmaps"}


def _library(name: str) -> Any:
    try:
        return import_module(name)
    except ImportError as error:
        package = _INSTALL.get(name.partition(".")[0], name.partition(".")[0])
        raise ConfigError(f"{name} is not installed: pip install {package} ({error})") from error


def _triangles(faces: ArrayLike, name: str, library: str) -> IntArray:
    found = np.asarray(faces)
    if found.ndim != 2 or found.shape[1] != 3:
        raise MeshError(f"{name}: the object of {library} has faces of shape {found.shape}; wanted triangles, (M, 3)")
    return found.astype(np.int64)


def to_trimesh(mesh: Mesh) -> Any:
    """Return a `trimesh.Trimesh`, which is not processed: vertices are neither merged nor sorted.

    Examples
    --------
    >>> import csm
    >>> to_trimesh(csm.load_humans()[0]).vertices.shape
    (6899, 3)
    """
    return _library("trimesh").Trimesh(mesh.vertices.copy(), mesh.faces.copy(), process=False)


def from_trimesh(found: Any, name: str = "mesh") -> Mesh:
    """Return a mesh of a `trimesh.Trimesh`; MeshError of what has no faces, such as a point cloud."""
    if not hasattr(found, "vertices") or not hasattr(found, "faces"):
        raise MeshError(f"{name}: wanted a trimesh.Trimesh, got a {type(found).__name__}")
    return Mesh(np.asarray(found.vertices, float), _triangles(found.faces, name, "trimesh"), name)


def to_meshio(mesh: Mesh, fields: Mapping[str, ArrayLike] | None = None) -> Any:
    """Return a `meshio.Mesh`; `fields` holds values of vertices, (N,) or (N, Q), by their names."""
    cells = [("triangle", mesh.faces)]
    return _library("meshio").Mesh(
        mesh.vertices, cells, point_data={k: np.asarray(v) for k, v in (fields or {}).items()}
    )


def from_meshio(found: Any, name: str = "mesh") -> Mesh:
    """Return a mesh of the triangles of a `meshio.Mesh`; MeshError if it has other faces as well, or none."""
    kinds = sorted({block.type for block in found.cells})
    if kinds != ["triangle"]:
        raise MeshError(
            f"{name}: the object of meshio has cells {', '.join(kinds) or 'of no kind'}; wanted triangles only"
        )
    faces = np.concatenate([block.data for block in found.cells])
    return Mesh(np.asarray(found.points, float), _triangles(faces, name, "meshio"), name)


def to_pyvista(mesh: Mesh, fields: Mapping[str, ArrayLike] | None = None) -> Any:
    """Return a `pyvista.PolyData`; `fields` holds values of vertices by their names, to be shown as `scalars=`."""
    faces = np.column_stack([np.full(mesh.n_faces, 3), mesh.faces]).ravel()
    made = _library("pyvista").PolyData(mesh.vertices, faces)
    for key, values in (fields or {}).items():
        made.point_data[key] = np.asarray(values)
    return made


def from_pyvista(found: Any, name: str = "mesh") -> Mesh:
    """Return a mesh of a `pyvista.PolyData`; MeshError if it has polygons other than triangles."""
    if not found.is_all_triangles:
        raise MeshError(f"{name}: the object of PyVista has polygons; call its triangulate() first")
    faces = np.asarray(found.faces).reshape(-1, 4)[:, 1:]
    return Mesh(np.asarray(found.points, float), _triangles(faces, name, "PyVista"), name)


def to_open3d(mesh: Mesh) -> Any:
    """Return an `open3d.geometry.TriangleMesh`."""
    o3d = _library("open3d")
    vectors = o3d.utility.Vector3dVector(mesh.vertices), o3d.utility.Vector3iVector(mesh.faces.astype(np.int32))
    return o3d.geometry.TriangleMesh(*vectors)


def from_open3d(found: Any, name: str = "mesh") -> Mesh:
    """Return a mesh of an `open3d.geometry.TriangleMesh`."""
    return Mesh(np.asarray(found.vertices, float), _triangles(found.triangles, name, "Open3D"), name)


def to_polyscope(mesh: Mesh, fields: Mapping[str, ArrayLike] | None = None, name: str = "") -> Any:
    """Register a mesh with polyscope, with values of vertices by their names; return polyscope's surface mesh."""
    made = _library("polyscope").register_surface_mesh(name or mesh.name or "mesh", mesh.vertices, mesh.faces)
    for key, values in (fields or {}).items():
        array = np.asarray(values)
        add = made.add_color_quantity if array.ndim == 2 and array.shape[1] == 3 else made.add_scalar_quantity
        add(key, array)
    return made


def to_pyg(mesh: Mesh, features: ArrayLike | None = None) -> Any:
    """Return a `torch_geometric.data.Data` with `pos` (N, 3), `face` (3, M) and, if given, features `x` (N, Q)."""
    torch = _library("torch")
    data = _library("torch_geometric.data").Data(
        pos=torch.as_tensor(mesh.vertices.astype(np.float32)), face=torch.as_tensor(np.array(mesh.faces.T))
    )
    if features is not None:
        data.x = torch.as_tensor(np.asarray(features), dtype=torch.float32)
    return data


def from_pyg(found: Any, name: str = "mesh") -> Mesh:
    """Return a mesh of a `torch_geometric.data.Data` with `pos` and `face`."""
    if getattr(found, "face", None) is None:
        raise MeshError(f"{name}: the object of PyG has no face; wanted pos (N, 3) and face (3, M)")
    return Mesh(found.pos.double().numpy(), _triangles(found.face.T, name, "PyG"), name)


def to_pyfm(mesh: Mesh) -> Any:
    """Return a `pyFM.mesh.TriMesh`, neither scaled nor centred."""
    return _library("pyFM.mesh").TriMesh(mesh.vertices, mesh.faces, area_normalize=False, center=False)


def from_pyfm(found: Any, name: str = "mesh") -> Mesh:
    """Return a mesh of a `pyFM.mesh.TriMesh`."""
    return Mesh(np.asarray(found.vertlist, float), _triangles(found.facelist, name, "pyFM"), name)


def to_geomfum(mesh: Mesh) -> Any:
    """Return a `geomfum.shape.TriangleMesh`."""
    return _library("geomfum.shape").TriangleMesh(mesh.vertices, mesh.faces)


def from_geomfum(found: Any, name: str = "mesh") -> Mesh:
    """Return a mesh of a `geomfum.shape.TriangleMesh`."""
    return Mesh(np.asarray(found.vertices, float), _triangles(found.faces, name, "geomfum"), name)
