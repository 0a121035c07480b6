"""Bringing things from the target of a map to its source: fields, labels, colours, normals, landmarks and textures.

A map source -> target carries functions the other way: what is known at a vertex of the target is looked up by every
vertex of the source that goes there.  This is the pull-back, and all of these but one are of this kind.  Landmarks are
points and no functions: to come from the target to the source they follow the map target -> source.
"""

from __future__ import annotations

import difflib
import os
from typing import Any, Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from csm._counts import counted
from csm._types import FloatArray, IntArray
from csm.errors import ConfigError, DataError
from csm.matching.barycentric import BarycentricMap, centre_faces
from csm.matching.maps import VertexMap
from csm.matching.texture import pull_texture
from csm.mesh.io.textured import read_textured
from csm.mesh.shape import Mesh
from csm.mesh.textured import Textured

Kind: TypeAlias = Literal["values", "labels", "faces", "landmarks", "colors", "normals", "texture"]
"""What is transferred:

- "values": numbers per vertex, shape (N_target, ...); linear within faces, so averages of three corners.
- "labels": per vertex, shape (N_target, ...), of any type; those of the nearest corner, never averaged.
- "faces": labels or numbers per face, shape (M_target, ...); a face of the source has those of the target's
  face that its centre lands on.
- "landmarks": vertices of the target, shape (L,); each becomes the vertex of the source that it goes to along
  `back`.
- "colors": uint8, shape (N_target, 3) or (N_target, 4); averaged and rounded.
- "normals": unit vectors, shape (N_target, 3); averaged and made unit again.  They stay as they stand in the
  space of the target: they are not turned with the surface.
- "texture": a `Textured` copy of the target, or the .obj, .glb or .gltf file of one; becomes a `Textured` copy
  of the source with the same images and new texture coordinates, see `csm.matching.texture`.
"""


def transfer(
    what: Any,
    along: BarycentricMap,
    source: Mesh,
    target: Mesh,
    kind: Kind | None = None,
    *,
    back: VertexMap | None = None,
    fill: Any = None,
) -> Any:
    """Bring something from the target of a map to the source.

    Parameters
    ----------
    what
        Numbers, labels, vertices, a texture or its file, as `Kind` says.
    along
        The map source -> target.
    source, target
        The meshes.
    kind
        One of these; None to tell by type and shape: a texture or its file, uint8 colours, whole numbers and text as
        labels, all other numbers as values, and rows for all faces as "faces".
    back
        The map target -> source, for landmarks.
    fill
        What a vertex, or a face, without a partner gets.  By default NaN for numbers, 0 for colours, and for labels -1,
        False or an empty text.

    Raises
    ------
    ConfigError
        If the kind is unknown, or cannot be told.
    DataError
        If there is not one row for each vertex or face, or no such vertex.

    Examples
    --------
    >>> two = Mesh(np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), np.array([[0, 1, 2], [0, 2, 3]]))
    >>> half_way = BarycentricMap(np.array([0, 1, 1, -1]), np.array([[1, 0, 0], [0, 0.2, 0.8], [0, 1, 0], [0] * 3]),
    ...     two.faces, 4)
    >>> transfer([0.0, 1.0, 2.0, 3.0], half_way, two, two)
    array([0. , 2.8, 2. , nan])
    >>> transfer([7, 8, 9, 6], half_way, two, two)
    array([ 7,  6,  9, -1])
    """
    if kind is not None:
        _require_kind(kind)
    if isinstance(what, Textured | str | os.PathLike):
        if kind not in (None, "texture"):
            raise ConfigError(f"kind={kind} wants an array, got a {type(what).__name__}")
        return pull_texture(what if isinstance(what, Textured) else read_textured(what), along, source, target)
    given = np.asarray(what.detach().cpu() if hasattr(what, "detach") else what)
    if kind == "landmarks":
        return push_landmarks(given, back, along)
    kind = kind or _told(given, target)
    if kind == "faces":
        return pull_faces(given, along, source, target, fill=fill)
    return _pulled(given, along, kind, fill)


def _require_kind(kind: str) -> None:
    if kind not in get_args(Kind):
        near = difflib.get_close_matches(str(kind).lower(), get_args(Kind), n=1)
        meant = f", did you mean {near[0]!r}?" if near else ""
        raise ConfigError(f"kind={kind!r}{meant}; wanted {', '.join(get_args(Kind))}, or None to tell by the data")


def _pulled(given: NDArray[Any], along: BarycentricMap, kind: Kind, fill: Any) -> NDArray[Any]:
    """Pull something back that is known at vertices."""
    if kind == "labels":
        return pull_labels(given, along, fill=fill)
    if kind == "texture":
        raise ConfigError(f"kind=texture wants csm.mesh.textured.Textured or its file, got an array of {given.shape}")
    found: NDArray[Any]
    if kind == "values":
        found = along.pull(given)
    else:
        found = pull_colors(given, along) if kind == "colors" else pull_normals(given, along)
    if fill is not None:
        found[along.faces < 0] = fill
    return found


def _told(given: NDArray[Any], target: Mesh) -> Kind:
    n, m = target.n_vertices, target.n_faces
    rows = len(given) if given.ndim else 0
    if rows == m and rows != n:
        return "faces"
    if rows != n or n == m or given.dtype.kind == "O":
        raise ConfigError(
            f"{target.name} has {counted(n, 'vertex')} and {counted(m, 'face')}, and what is to be transferred is "
            f"{given.dtype} of shape {given.shape}; wanted a row for each vertex or each face, or "
            f"kind={'|'.join(get_args(Kind))}"
        )
    if given.dtype == np.uint8 and given.ndim == 2 and given.shape[1] in (3, 4):
        return "colors"
    return "values" if given.dtype.kind in "fc" else "labels"


def pull_labels(labels: ArrayLike, along: BarycentricMap, *, fill: Any = None) -> NDArray[Any]:
    """Give every vertex of the source the label of the corner nearest to where it lands."""
    given = np.asarray(labels)
    if given.ndim == 0 or len(given) != along.n_target:
        raise DataError(
            f"{along.source} -> {along.target}: labels of shape {given.shape}, wanted one for each of the "
            f"{along.n_target} vertices of {along.target}"
        )
    return _looked_up(given, along.vertex_map().indices, fill)


def pull_faces(
    values: ArrayLike, along: BarycentricMap, source: Mesh, target: Mesh, *, fill: Any = None
) -> NDArray[Any]:
    """Give every face of the source what the face of the target has that its centre lands on."""
    given = np.asarray(values)
    if given.ndim == 0 or len(given) != target.n_faces:
        raise DataError(
            f"{along.source} -> {along.target}: face values of shape {given.shape}, wanted one for each of the "
            f"{target.n_faces} faces of {along.target}"
        )
    return _looked_up(given, centre_faces(along, source, target).faces, fill)


def _looked_up(given: NDArray[Any], at: IntArray, fill: Any) -> NDArray[Any]:
    """Return rows by number; those without a number are filled, in a type that can hold what they are filled with."""
    if fill is None:
        fill = {"f": np.nan, "c": np.nan, "i": -1, "u": -1, "b": False}.get(given.dtype.kind, "")
    if given.dtype.kind == "u" and fill == -1:
        given = given.astype(np.int64)
    found = given[at]
    if (at < 0).any():
        found[at < 0] = fill
    return found


def pull_colors(colors: ArrayLike, along: BarycentricMap) -> NDArray[np.uint8]:
    """Average uint8 colours, and round; black where there is no partner."""
    given = np.asarray(colors)
    if given.dtype != np.uint8:
        raise DataError(
            f"{along.target}: colours are {given.dtype}, wanted uint8 from 0 to 255; others are kind=values"
        )
    rounded: NDArray[np.uint8] = np.round(np.nan_to_num(along.pull(given))).astype(np.uint8)
    return rounded


def pull_normals(normals: ArrayLike, along: BarycentricMap) -> FloatArray:
    """Average unit vectors, and make them unit again; zero where they cancel, NaN where there is no partner."""
    given = np.asarray(normals, dtype=np.float64)
    if given.ndim != 2 or given.shape[1] != 3:
        raise DataError(f"{along.target}: normals have shape {given.shape}, wanted ({along.n_target}, 3)")
    found = along.pull(given)
    length = np.linalg.norm(found, axis=1, keepdims=True)
    unit: FloatArray = np.divide(found, length, out=np.zeros_like(found), where=~(length < 1e-12))
    return unit


def push_landmarks(landmarks: ArrayLike, back: VertexMap | None, along: BarycentricMap) -> IntArray:
    """Return where vertices of the target go along the map target -> source; -1 where they have no partner."""
    given = np.asarray(landmarks)
    if back is None:
        raise ConfigError(f"landmarks of {along.target} need the map {along.target} -> {along.source}: give back=")
    wrong = given.ndim != 1 or (given.size > 0 and given.dtype.kind not in "iu")
    if wrong or given.min(initial=0) < 0 or given.max(initial=-1) >= len(back):
        raise DataError(
            f"{along.target}: landmarks are {given.dtype} of shape {given.shape}; wanted a list of its vertices, "
            f"0..{len(back) - 1}"
        )
    return back.indices[given.astype(np.int64)]
