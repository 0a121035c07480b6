"""Small meshes with known geometry, shared by the tests."""

from __future__ import annotations

import numpy as np
import trimesh
from scipy.spatial import Delaunay

from csm.mesh.shape import Mesh


def sphere(subdivisions: int = 3, radius: float = 1.0) -> Mesh:
    """Icosphere: 162, 642, 2562 vertices for 2, 3, 4 subdivisions."""
    m = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)
    return Mesh(m.vertices, m.faces, "sphere")


def torus(major: float = 1.0, minor: float = 0.4, n: int = 40, m: int = 20) -> Mesh:
    """Closed torus about the z axis, n sections around the axis and m around the tube."""
    u, v = np.meshgrid(np.arange(n) * 2 * np.pi / n, np.arange(m) * 2 * np.pi / m, indexing="ij")
    r = major + minor * np.cos(v)
    vertices = np.stack([r * np.cos(u), r * np.sin(u), minor * np.sin(v)], axis=-1).reshape(-1, 3)
    i, j = (a.ravel() for a in np.meshgrid(np.arange(n), np.arange(m), indexing="ij"))
    a, b, c, d = i * m + j, (i + 1) % n * m + j, (i + 1) % n * m + (j + 1) % m, i * m + (j + 1) % m
    return Mesh(vertices, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]), "torus")


def cylinder(radius: float = 0.5, height: float = 3.0, n: int = 24, m: int = 30) -> Mesh:
    """Open cylinder about the z axis, n vertices around and m along."""
    u, z = np.meshgrid(np.arange(n) * 2 * np.pi / n, np.linspace(0, height, m), indexing="ij")
    vertices = np.stack([radius * np.cos(u), radius * np.sin(u), z], axis=-1).reshape(-1, 3)
    i, j = (a.ravel() for a in np.meshgrid(np.arange(n), np.arange(m - 1), indexing="ij"))
    a, b, c, d = i * m + j, (i + 1) % n * m + j, (i + 1) % n * m + j + 1, i * m + j + 1
    return Mesh(vertices, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]), "cylinder")


def plane(n: int = 15, seed: int = 0) -> Mesh:
    """Unit square in z = 0 with jittered inner vertices: flat, with a boundary."""
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(0, 1, n), np.linspace(0, 1, n), indexing="ij"))
    inner = (x > 0) & (x < 1) & (y > 0) & (y < 1)
    jitter = np.random.default_rng(seed).uniform(-0.3 / n, 0.3 / n, (len(x), 2)) * inner[:, None]
    points = np.stack([x, y], 1) + jitter
    faces = Delaunay(points).simplices
    a, b, c = (points[faces[:, k]] for k in range(3))
    flip = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0] < 0
    faces[flip] = faces[flip][:, ::-1]
    return Mesh(np.column_stack([points, np.zeros(len(points))]), faces, "plane")


def blob(subdivisions: int = 3, seed: int = 1) -> Mesh:
    """A closed surface without symmetry: a sphere with a few smooth, seeded bumps."""
    m = trimesh.creation.icosphere(subdivisions=subdivisions)
    x = np.asarray(m.vertices)
    rng = np.random.default_rng(seed)
    r = np.ones(len(x))
    for _ in range(6):
        centre = rng.normal(size=3)
        centre /= np.linalg.norm(centre)
        r += rng.uniform(0.2, 0.9) * np.exp(-((x - centre) ** 2).sum(1) / rng.uniform(0.05, 0.3))
    return Mesh(x * r[:, None] * np.array([1.0, 1.3, 0.8]), m.faces, "blob")


def rotation(seed: int = 0) -> np.ndarray:
    """A random proper rotation matrix, shape (3, 3)."""
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    q[:, 0] *= np.linalg.det(q)
    return q
