from __future__ import annotations

import numpy as np
import potpourri3d
import pytest

from csm.errors import ConfigError
from csm.mesh.shape import Mesh
from csm.operators.frames import face_frames
from csm.operators.laplacian import anisotropic_stiffness, degenerate_faces, stiffness, vertex_areas
from csm.operators.spectrum import eigenpairs
from tests.shapes import blob, cylinder, plane, sphere, torus

SHAPES = [sphere(2), torus(), cylinder(), plane(), blob(2)]


def matrices(mesh: Mesh):
    return anisotropic_stiffness(mesh, face_frames(mesh))


@pytest.mark.parametrize("mesh", SHAPES, ids=lambda m: m.name)
def test_alpha_zero_is_the_cotangent_matrix_of_potpourri3d(mesh):
    reference = potpourri3d.cotan_laplacian(mesh.vertices, mesh.faces).toarray()
    scale = np.abs(reference).max()
    np.testing.assert_allclose(stiffness(mesh).toarray(), reference, atol=1e-9 * scale)
    assert abs(matrices(mesh).at(0.0, 0.7) - stiffness(mesh)).max() <= 1e-12 * scale


@pytest.mark.parametrize("mesh", SHAPES, ids=lambda m: m.name)
@pytest.mark.parametrize("alpha", [0.0, 4.0, 100.0])
def test_rows_sum_to_zero_symmetric_and_positive_semidefinite(mesh, alpha):
    dense = matrices(mesh).at(alpha, 0.4).toarray()
    np.testing.assert_allclose(dense.sum(axis=1), 0, atol=1e-12 * np.abs(dense).max())
    np.testing.assert_allclose(dense, dense.T, atol=1e-13 * np.abs(dense).max())
    assert np.linalg.eigvalsh(dense).min() > -1e-10 * np.abs(dense).max()


def test_angle_has_period_pi():
    m = matrices(blob(2))
    assert abs(m.at(10, 0.3) - m.at(10, 0.3 + np.pi)).max() < 1e-12
    assert abs(m.at(10, 0.3) - m.at(10, 0.3 + np.pi / 2)).max() > 0.1


def test_right_angle_exchanges_the_axes():
    m = matrices(blob(2))
    both = (m.at(10, 0.3) + m.at(10, 0.3 + np.pi / 2)).toarray()
    np.testing.assert_allclose(both, (1 + 1 / 11) * m.b0.toarray(), atol=1e-12)


def test_against_the_formula_face_by_face():
    """As published: turn the frame about the inward normal by -theta, then sum over corner pairs."""
    mesh, alpha, theta = blob(1), 7.0, 0.6
    frames = face_frames(mesh)
    expected = np.zeros((mesh.n_vertices, mesh.n_vertices))
    for f, face in enumerate(mesh.faces):
        x = mesh.vertices[face]
        edges = [x[2] - x[1], x[0] - x[2], x[1] - x[0]]
        inward = np.cross(edges[2], edges[0])
        inward = -inward / np.linalg.norm(inward)
        u_max = frames.v[f]
        u_min = np.cross(inward, u_max)

        def turned(a, axis=inward, t=-theta):
            return a * np.cos(t) + np.cross(axis, a) * np.sin(t)

        for p in range(3):
            for q in range(3):
                along_min = (edges[p] @ turned(u_min)) * (edges[q] @ turned(u_min))
                along_max = (edges[p] @ turned(u_max)) * (edges[q] @ turned(u_max))
                expected[face[p], face[q]] += (along_min / (1 + alpha) + along_max) / (4 * mesh.face_areas[f])
    np.testing.assert_allclose(matrices(mesh).at(alpha, theta).toarray(), expected, atol=1e-12)


def test_at_angle_zero_heat_runs_fast_along_a_limb():
    limb = cylinder(radius=0.1, height=3.0, n=12, m=60)
    m, mass = matrices(limb), vertex_areas(limb)
    along, across = (eigenpairs(m.at(4.0, theta), mass, 2).evals[1] for theta in (0.0, np.pi / 2))
    free_rod = (np.pi / 3.0) ** 2
    assert along == pytest.approx(free_rod, rel=1e-2)
    assert across == pytest.approx(free_rod / 5, rel=1e-2)


def test_the_three_matrices_share_one_pattern():
    m = matrices(torus())
    for other in (m.bc, m.bs, m.at(3, 1)):
        np.testing.assert_array_equal(other.indices, m.b0.indices)
        np.testing.assert_array_equal(other.indptr, m.b0.indptr)


@pytest.mark.parametrize("mesh", SHAPES, ids=lambda m: m.name)
def test_vertex_areas_share_out_the_surface(mesh):
    expected = np.zeros(mesh.n_vertices)
    for face, area in zip(mesh.faces, mesh.face_areas, strict=True):
        expected[face] += area / 3
    np.testing.assert_allclose(vertex_areas(mesh), expected, rtol=1e-12)
    assert vertex_areas(mesh).sum() == pytest.approx(mesh.area)


def test_a_face_without_area_stays_finite_and_ties_its_corners():
    """A point put on an edge of one of its two faces: between them a triangle without area."""
    square = np.array([[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0], [1, 1, 0.0]])
    faces = np.array([[0, 1, 2], [0, 2, 4], [0, 4, 3], [4, 2, 3]])
    mesh = Mesh(square, faces)
    np.testing.assert_array_equal(degenerate_faces(mesh), [1])
    dense = matrices(mesh).at(4, 0.3).toarray()
    assert np.isfinite(dense).all()
    second = eigenpairs(stiffness(mesh), vertex_areas(mesh), 2).evecs[:, 1]
    assert second[4] == pytest.approx((second[0] + second[2]) / 2, abs=1e-4)


def test_no_face_of_ordinary_meshes_is_floored():
    assert all(degenerate_faces(mesh).size == 0 for mesh in SHAPES)


@pytest.mark.parametrize(("alpha", "theta"), [(-1.0, 0.0), (np.nan, 0.0), (1.0, np.inf)])
def test_impossible_strengths_and_angles_are_refused(alpha, theta):
    with pytest.raises(ConfigError, match="alpha"):
        matrices(sphere(1)).at(alpha, theta)
