"""What csm takes for a mesh: its own types, files, pairs of arrays, and objects of other libraries."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any, Protocol, TypeAlias, runtime_checkable

import numpy as np

from csm.errors import ConfigError
from csm.mesh.io.meshes import read_mesh, read_polygons
from csm.mesh.polygons import PolygonMesh
from csm.mesh.shape import Mesh

_WANTED = (
    "wanted a mesh: a file, what csm.read_mesh returns, a pair (vertices, faces) of arrays, or an object with "
    "vertices and faces, such as a trimesh.Trimesh"
)


@runtime_checkable
class HasFaces(Protocol):
    """An object with `vertices`, shape (N, 3), and `faces`, shape (M, 3), such as a ``trimesh.Trimesh``."""

    @property
    def vertices(self) -> Any:
        """Positions."""

    @property
    def faces(self) -> Any:
        """0-based vertex numbers."""


MeshLike: TypeAlias = HasFaces | PolygonMesh | str | os.PathLike[str] | Sequence[Any]
"""A file, a mesh of csm or of another library, or a pair (vertices, faces)."""


def as_mesh(thing: MeshLike, name: str = "mesh") -> Mesh:
    """Return what is given as a triangle mesh of csm; a `Mesh` is returned as it is.

    Parameters
    ----------
    thing
        A file that `csm.read_mesh` reads, a `Mesh`, a `PolygonMesh` of triangles, a pair (vertices, faces) of arrays,
        tensors or lists, or an object that has such as `vertices` and `faces`, which a ``trimesh.Trimesh`` does.
    name
        What a mesh is called that is neither a file nor of csm.

    Raises
    ------
    ConfigError
        If it is something else.
    MeshError
        If the file cannot be read, the arrays do not form a mesh, or a face is no triangle.

    Examples
    --------
    >>> as_mesh(([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]), "one triangle")
    Mesh('one triangle', 3 vertices, 1 face)
    """
    if isinstance(thing, str | os.PathLike):
        return read_mesh(thing)
    found = as_polygons(thing, name)
    return found if isinstance(found, Mesh) else found.triangles()


def as_polygons(thing: MeshLike, name: str = "mesh") -> Mesh | PolygonMesh:
    """Return what is given as a mesh of csm whose faces may have any number of corners; see `as_mesh`."""
    if isinstance(thing, Mesh | PolygonMesh):
        return thing
    if isinstance(thing, str | os.PathLike):
        return read_polygons(thing)
    if isinstance(thing, tuple | list) and len(thing) == 2:
        return Mesh(_array(thing[0]), _array(thing[1]), name)
    if isinstance(thing, HasFaces):
        return Mesh(_array(thing.vertices), _array(thing.faces), name)
    raise ConfigError(f"{_WANTED}; got {_in_words(thing)}")


def _array(values: Any) -> Any:
    """Return a tensor that may need gradients or be on another device as an array, all else as it is."""
    return values.detach().cpu().numpy() if hasattr(values, "detach") else values


def _in_words(thing: object) -> str:
    """Return a phrase for what is no mesh."""
    kind = type(thing).__name__
    if hasattr(thing, "geometry"):
        return (
            f"a {kind}, which may hold several meshes; take one of them (scene.geometry has them by name), or join "
            "them (scene.to_mesh() in trimesh)"
        )
    if hasattr(thing, "vertices"):
        return f"a {kind}, which has vertices but no faces; csm works on surfaces, so reconstruct one first"
    if isinstance(thing, np.ndarray) or hasattr(thing, "detach"):
        return f"an array of shape {tuple(getattr(thing, 'shape', ()))} alone; give both, (vertices, faces)"
    if isinstance(thing, tuple | list):
        return f"a {kind} of {len(thing)}"
    return f"a {kind}"
