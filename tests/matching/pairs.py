"""Pairs of described meshes for the tests of refinements, with the true map of each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch

from csm._types import FloatArray, IntArray
from csm.data.store import Store
from csm.matching.base import Described
from csm.matching.maps import VertexMap
from csm.matching.methods import as_method
from csm.mesh.debris import unit_area
from csm.mesh.shape import Mesh
from csm.operators import Operators, Spectrum
from tests.shapes import blob, rotation


def spectrum_of(mesh: Mesh, k: int) -> Spectrum:
    """The first k eigenpairs of a mesh at unit area."""
    return Operators(unit_area(mesh)).lbo(k)


def described(mesh: Mesh, store: Store, features: FloatArray | None = None) -> Described:
    """A mesh with the given features, ACD by default."""
    if features is None:
        return as_method("acd").describe(mesh, store)
    return Described(mesh, torch.from_numpy(np.asarray(features, dtype=np.float32)), store=store)


def relabelled(mesh: Mesh, seed: int = 0) -> tuple[Mesh, IntArray]:
    """The mesh turned, with its vertices in another order, and the vertex there of each vertex here."""
    order = np.random.default_rng(seed).permutation(mesh.n_vertices)
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    return Mesh((mesh.vertices @ rotation(seed).T)[order], place[mesh.faces], f"{mesh.name} relabelled"), place


def mirrored(mesh: Mesh, axis: int = 0) -> Mesh:
    """The mirror image, oriented outwards again; vertex i is the image of vertex i."""
    sign = np.ones(3)
    sign[axis] = -1
    return Mesh(mesh.vertices * sign, mesh.faces[:, ::-1], f"{mesh.name} mirrored")


def bent(mesh: Mesh) -> Mesh:
    """A smooth deformation that is no isometry; vertex i stays vertex i."""
    x = mesh.vertices
    return Mesh(
        x + 0.08 * np.sin(x @ np.random.default_rng(0).normal(size=(3, 3)) + 1), mesh.faces, f"{mesh.name} bent"
    )


def as_map(indices: IntArray, source: Described, target: Described) -> VertexMap:
    return VertexMap(indices, target.mesh.n_vertices, source.mesh.name, target.mesh.name)


@dataclass(frozen=True, eq=False)
class Known:
    """Two described shapes, the true map, and one that begins near it."""

    source: Described
    target: Described
    truth: IntArray
    start: VertexMap


def known(store: Store, wrong: float = 0.3) -> Known:
    """A blob and a bent, relabelled copy with a start in which some vertices go anywhere."""
    mesh = blob(2)
    other, truth = relabelled(bent(mesh))
    rng = np.random.default_rng(1)
    indices = np.where(rng.random(len(truth)) < wrong, rng.integers(0, len(truth), len(truth)), truth)
    wave = np.cos(3 * mesh.vertices @ rng.normal(size=(3, 5)))
    noisy = wave + 0.1 * rng.normal(size=wave.shape)
    moved = np.empty_like(noisy)
    moved[truth] = noisy + 0.1 * rng.normal(size=wave.shape)
    source, target = described(mesh, store, noisy), described(other, store, moved)
    return Known(source, target, truth, as_map(indices, source, target))
