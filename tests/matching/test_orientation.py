"""Crossed gradients, against closed forms and a loop over the faces."""

from __future__ import annotations

import numpy as np
import pytest

from csm.matching.orientation import cross_gradients, spectral_turns
from csm.mesh.shape import Mesh
from tests.matching.pairs import mirrored, spectrum_of
from tests.matching.peers import pyfm_mesh
from tests.shapes import blob, plane, rotation, sphere


def by_faces(mesh: Mesh, f: np.ndarray, g: np.ndarray) -> np.ndarray:
    """Gradients in space, face by face, then the mean around each vertex."""
    total, area = np.zeros(mesh.n_vertices), np.zeros(mesh.n_vertices)
    for face in mesh.faces:
        a, b, c = mesh.vertices[face]
        normal = np.cross(b - a, c - a)
        frame = np.stack([b - a, c - a, normal])
        grad_f, grad_g = (np.linalg.solve(frame, [h[face[1]] - h[face[0]], h[face[2]] - h[face[0]], 0]) for h in (f, g))
        size = np.linalg.norm(normal) / 2
        total[face] += size * (normal / (2 * size)) @ np.cross(grad_f, grad_g)
        area[face] += size
    return total / area


def test_on_a_plane_it_is_the_determinant_of_two_linear_functions():
    mesh = plane()
    a = np.array([[1.0, 2], [-3, 0.5]])  # columns are f
    b = np.array([[0.0, 1, 2], [4, -1, 1]])
    found = cross_gradients(mesh, mesh.vertices[:, :2] @ a, mesh.vertices[:, :2] @ b)
    assert found.shape == (mesh.n_vertices, 2, 3)
    wanted = np.array([[np.linalg.det(np.stack([f, g], 1)) for g in b.T] for f in a.T])
    np.testing.assert_allclose(found, np.broadcast_to(wanted, found.shape), atol=1e-10)


def test_on_a_sphere_it_is_the_third_coordinate_of_the_normal():
    mesh = sphere(4)
    found = cross_gradients(mesh, mesh.vertices, mesh.vertices)
    x, y, z = mesh.vertices.T
    zero = np.zeros_like(x)
    wanted = np.array([[zero, z, -y], [-z, zero, x], [y, -x, zero]]).transpose(2, 0, 1)
    np.testing.assert_allclose(found, wanted, atol=0.01)


def test_it_is_the_mean_of_the_faces_around_a_vertex():
    mesh = blob(1)
    f, g = np.random.default_rng(0).normal(size=(2, mesh.n_vertices))
    np.testing.assert_allclose(cross_gradients(mesh, f[:, None], g[:, None])[:, 0, 0], by_faces(mesh, f, g))


def test_it_turns_with_nothing_but_the_orientation():
    mesh = blob(2)
    f = np.random.default_rng(1).normal(size=(mesh.n_vertices, 3))
    found = cross_gradients(mesh, f, f)
    np.testing.assert_allclose(found, -found.transpose(0, 2, 1), atol=1e-9)
    turned = Mesh(mesh.vertices @ rotation().T + 3, mesh.faces)
    np.testing.assert_allclose(cross_gradients(turned, f, f), found, atol=1e-8)
    np.testing.assert_allclose(cross_gradients(mirrored(mesh), f, f), -found, atol=1e-8)
    np.testing.assert_allclose(cross_gradients(Mesh(mesh.vertices, mesh.faces[:, ::-1]), f, f), -found, atol=1e-8)
    double = Mesh(2 * mesh.vertices, mesh.faces)
    np.testing.assert_allclose(cross_gradients(double, f, f), found / 4, atol=1e-8)


def test_a_vertex_of_no_face_has_zero():
    mesh = Mesh(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [5, 5, 5]]), np.array([[0, 1, 2]]))
    assert cross_gradients(mesh, mesh.vertices, mesh.vertices)[:, 0, 1].tolist() == [1, 1, 1, 0]


@pytest.mark.parametrize("smooth", [6, 30])
def test_spectral_turns_are_crossed_gradients_without_the_high_frequencies(smooth):
    mesh = blob(2)
    spectrum = spectrum_of(mesh, 30)
    found = spectral_turns(mesh, spectrum, 4, smooth)
    assert found.shape == (mesh.n_vertices, 4, 4)
    np.testing.assert_allclose(found, -found.transpose(0, 2, 1))
    phi = spectrum.evecs[:, :smooth]
    raw = by_faces(mesh, spectrum.evecs[:, 1], spectrum.evecs[:, 3])
    roots = np.sqrt(spectrum.mass)
    best = np.linalg.lstsq(roots[:, None] * phi, roots * raw, rcond=None)[0]
    np.testing.assert_allclose(found[:, 1, 3], phi @ best, atol=1e-7)
    assert np.abs(found[:, 0]).max() < 1e-9, "the first eigenfunction is constant"


@pytest.mark.peers
def test_it_is_the_orientation_operator_of_pyfm(small_humans):
    mesh = small_humans[0].mesh
    f, g = np.random.default_rng(2).normal(size=(2, mesh.n_vertices))
    theirs = pyfm_mesh(mesh)
    wanted = theirs.orientation_op(theirs.gradient(f)) @ g
    found = cross_gradients(mesh, f[:, None], g[:, None])[:, 0, 0]
    np.testing.assert_allclose(found, wanted, rtol=1e-6, atol=1e-6 * np.abs(wanted).max())
