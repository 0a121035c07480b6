from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse

from csm.errors import ConfigError
from csm.mesh.shape import Mesh
from csm.operators import Operators
from csm.operators.geodesic import geodesics
from csm.operators.polar import polar_discs
from csm.operators.stencils import polar_patches
from csm.operators.stencils.polar_patches import PolarPatches
from tests.shapes import blob, plane, rotation

SMALL = PolarPatches(radius=0.12, rings=2, rays=5, spread=0.6)


def dense(mesh: Mesh, made: PolarPatches) -> np.ndarray:
    """The weights, shape (N, rings, rays, N)."""
    arrays = made(Operators(mesh))
    n = mesh.n_vertices
    rows = len(arrays["indptr"]) - 1
    matrix = sparse.csr_array((arrays["values"], arrays["indices"], arrays["indptr"]), shape=(rows, n))
    return matrix.toarray().reshape(n, made.rings, made.rays, n)


def by_loops(mesh: Mesh, made: PolarPatches) -> np.ndarray:
    mesh = mesh.unit_area()
    radius = made.radius * max(geodesics(mesh, "edge").rows(np.arange(mesh.n_vertices)).ravel())
    areas, discs = Operators(mesh).mass, polar_discs(mesh, 1.5 * radius)
    weights = np.zeros((mesh.n_vertices, made.rings, made.rays, mesh.n_vertices))
    for x in range(mesh.n_vertices):
        here = slice(discs.indptr[x], discs.indptr[x + 1])
        places = dict(zip(discs.vertices[here], zip(discs.radii[here], discs.angles[here], strict=True), strict=True))
        for s in range(made.rings):
            for t in range(made.rays):
                row = weights[x, s, t]
                width, turn = radius / made.rings, 2 * np.pi / made.rays
                row[x] = areas[x] * np.exp(-((((s + 0.5) * width) / (made.spread * width)) ** 2) / 2)
                for y, (rho, theta) in places.items():
                    off = min(abs(theta - t * turn + k * 2 * np.pi) for k in (-1, 0, 1))
                    row[y] = areas[y] * np.exp(
                        -(((rho - (s + 0.5) * width) / (made.spread * width)) ** 2) / 2
                        - (off / (made.spread * turn)) ** 2 / 2
                    )
                row[row < 0.01 * row.max()] = 0
                row /= row.sum()
    return weights


@pytest.mark.parametrize("mesh", [blob(1), plane(7)], ids=["closed", "open"])
def test_against_loops_over_windows_and_vertices(mesh):
    np.testing.assert_allclose(dense(mesh, SMALL), by_loops(mesh, SMALL), atol=1e-5)


def test_no_window_is_empty_and_each_averages():
    for radius in (1e-4, 0.02, 0.3):
        weights = dense(blob(1), replace(SMALL, radius=radius))
        np.testing.assert_allclose(weights.sum(axis=3), 1, rtol=1e-6)
        assert weights.min() >= 0


def test_blocks_do_not_show(monkeypatch):
    whole = dense(blob(1), SMALL)
    monkeypatch.setattr(polar_patches, "_BLOCK", 5)
    np.testing.assert_array_equal(dense(blob(1), SMALL), whole)


def test_a_rigid_motion_a_scale_and_a_new_numbering_change_nothing():
    mesh = blob(1)
    new_of_old = np.random.default_rng(0).permutation(mesh.n_vertices)
    points = np.empty_like(mesh.vertices)
    points[new_of_old] = 3.0 * mesh.vertices @ rotation(2).T + 1.0
    after = dense(replace(mesh, vertices=points, faces=new_of_old[mesh.faces]), SMALL)
    np.testing.assert_allclose(after[np.ix_(new_of_old, range(2), range(5), new_of_old)], dense(mesh, SMALL), atol=1e-5)


def test_windows_of_a_fine_plane_lie_where_they_should():
    mesh, made = plane(41), PolarPatches(radius=0.1, rings=2, rays=8, spread=0.4)
    arrays = made(Operators(mesh, unit_area=False))
    rows = len(arrays["indptr"]) - 1
    matrix = sparse.csr_array((arrays["values"], arrays["indices"], arrays["indptr"]), shape=(rows, mesh.n_vertices))
    x = int(np.linalg.norm(mesh.vertices - [0.5, 0.5, 0], axis=1).argmin())
    places = (matrix @ mesh.vertices[:, :2]).reshape(mesh.n_vertices, 2, 8, 2)[x] - mesh.vertices[x, :2]
    radius = 0.1 * geodesics(mesh, "edge").diameter(100)
    lengths = np.linalg.norm(places, axis=2)
    np.testing.assert_allclose(lengths, np.array([[0.25], [0.75]]) * radius * np.ones(8), atol=0.12 * radius)
    bearings = np.unwrap(np.arctan2(places[1, :, 1], places[1, :, 0]))
    np.testing.assert_allclose(np.diff(bearings), 2 * np.pi / 8, atol=0.2)


@pytest.mark.parametrize("wrong", [{"radius": 0.0}, {"rings": 0}, {"rays": 0}, {"spread": 0.0}])
def test_settings_out_of_range_are_refused(wrong):
    with pytest.raises(ConfigError, match="wanted"):
        replace(SMALL, **wrong)
