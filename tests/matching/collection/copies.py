"""Copies of one small shape whose vertices are in another order each: the true maps are known."""

from __future__ import annotations

import numpy as np

from csm.matching.refinement.multistart import Multistart
from csm.mesh.shape import Mesh
from tests.shapes import blob, rotation

QUICK = Multistart(signs=4, samples=150, schedule=(20, 40, 60))


def copy(order: np.ndarray, name: str, seed: int) -> Mesh:
    """Vertex n is vertex order[n] of the blob, turned in space and stretched a little."""
    mesh, place = blob(), np.argsort(order)
    stretch = 1 + 0.02 * np.random.default_rng(seed).normal(size=3)
    return Mesh((mesh.vertices[order] * stretch) @ rotation(seed).T, place[mesh.faces], name)


def orders(n: int) -> list[np.ndarray]:
    return [np.random.default_rng(i).permutation(blob().n_vertices) for i in range(n)]


def copies(n: int) -> list[Mesh]:
    return [copy(order, f"s{i}", i) for i, order in enumerate(orders(n))]


def share_right(indices: np.ndarray, source: int, target: int, n: int = 5) -> float:
    """Return the share of vertices that a map between two copies sends to within an edge or two of their place."""
    every, vertices = orders(n), blob().vertices
    away = np.linalg.norm(vertices[every[target][indices]] - vertices[every[source]], axis=1)
    return float((away < 0.2).mean())
