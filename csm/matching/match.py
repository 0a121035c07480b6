"""Matching two meshes in one call."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TypeAlias

from csm._types import IntArray
from csm.data.store import Store
from csm.descriptors.base import Descriptor
from csm.matching.base import Matcher, require_device
from csm.matching.maps import VertexMap
from csm.matching.methods import Method, as_method
from csm.matching.nearest import Rows, nearest
from csm.matching.registry import matcher as as_matcher
from csm.mesh.io import read_mesh
from csm.mesh.shape import Mesh

MeshLike: TypeAlias = Mesh | str | os.PathLike[str]


@dataclass(frozen=True, eq=False)
class Match:
    """Two meshes and the map from one to the other.

    Parameters
    ----------
    source, target
        The meshes.
    map
        From every vertex of the source to a vertex of the target.
    method, matcher
        How it was made.
    """

    source: Mesh
    target: Mesh
    map: VertexMap
    method: Method
    matcher: Matcher

    @property
    def indices(self) -> IntArray:
        """For each vertex of the source a vertex of the target, shape (N_source,), 0-based."""
        return self.map.indices

    @property
    def coverage(self) -> float:
        """Fraction of the target's vertices that something is mapped to."""
        return self.map.coverage

    def __repr__(self) -> str:
        return f"Match({self.map.source} -> {self.map.target} by {self.method.name}, {self.matcher.name})"


def match_meshes(
    source: MeshLike,
    target: MeshLike,
    method: Method | Descriptor | str = "acd",
    matcher: Matcher | str = "nearest",
    *,
    store: Store | None = None,
    device: str = "cpu",
) -> Match:
    """Match two meshes.

    Parameters
    ----------
    source, target
        Meshes, or files that `csm.read_mesh` reads.
    method
        A descriptor, the name of a preset (the default is csm's own setting of ACD), or a trained network of
        `csm.load_model`.
    matcher
        A matcher or its name: "nearest", or for networks "argmax".
    store
        Where descriptors and bases are kept; by default csm's store in the user's cache folder.
    device
        Where features are compared and networks run: "cpu", "cuda", ...

    Returns
    -------
    Match
        Its `indices`, shape (N_source,), hold for each vertex of the source the vertex of the target.

    Raises
    ------
    MeshError
        If a file cannot be read or a mesh cannot be used.
    ConfigError
        If there is no such method, matcher or device.

    Examples
    --------
    >>> import csm
    >>> humans = csm.load_humans()
    >>> csm.match_meshes(humans.mesh("s00_p00"), humans.mesh("s00_p02"), "hks")  # doctest: +SKIP
    Match(s00_p00 -> s00_p02 by hks, nearest)
    """
    chosen, rule, store = as_method(method), as_matcher(matcher), store or Store()
    meshes = [mesh if isinstance(mesh, Mesh) else read_mesh(mesh) for mesh in (source, target)]
    require_device(device)
    here, there = (chosen.describe(mesh, store, device) for mesh in meshes)
    return Match(meshes[0], meshes[1], rule(here, there), chosen, rule)


def match_features(
    source: Rows, target: Rows, *, source_name: str = "source", target_name: str = "target"
) -> VertexMap:
    """Map each of N_source rows to the nearest of N_target rows, see `csm.matching.nearest.nearest`.

    Parameters
    ----------
    source, target
        Shapes (N_source, Q) and (N_target, Q): arrays, tensors, or what a descriptor returns.
    source_name, target_name
        Names of the shapes.

    Examples
    --------
    >>> import numpy as np
    >>> match_features(np.array([[0.1], [0.9]]), np.array([[1.0], [0.0]])).indices
    array([1, 0])
    """
    return VertexMap(nearest(source, target), len(target), source_name, target_name)
