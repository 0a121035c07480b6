from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse

from csm.errors import ConfigError
from csm.mesh.shape import Mesh
from csm.operators import Operators
from csm.operators.stencils.gradients import VertexGradients
from tests.shapes import blob, plane, rotation, sphere


def components(mesh: Mesh, regularisation: float = 1e-5) -> list[np.ndarray]:
    arrays = VertexGradients(regularisation)(Operators(mesh, unit_area=False))
    return [sparse.csr_array((v, arrays["indices"], arrays["indptr"])).toarray() for v in arrays["values"]]


def products(mesh: Mesh, f: np.ndarray, g: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Inner and outer product of two gradients: what does not depend on the frame."""
    x, y = components(mesh, 1e-9)
    return (x @ f) * (x @ g) + (y @ f) * (y @ g), (x @ f) * (y @ g) - (y @ f) * (x @ g)


def neighbours(mesh: Mesh, vertex: int) -> list[int]:
    return sorted({int(v) for face in mesh.faces if vertex in face for v in face} - {vertex})


@pytest.mark.parametrize("regularisation", [1e-5, 1e-1])
def test_against_a_loop(regularisation):
    mesh = plane(5)
    mesh = replace(mesh, vertices=mesh.vertices * (1 + np.array([0.3, 0.2, 0.0]) * mesh.vertices))  # no equal edges
    x, y = components(mesh, regularisation)
    for i in range(mesh.n_vertices):
        ring = neighbours(mesh, i)
        spans = mesh.vertices[ring] - mesh.vertices[i]
        e1 = spans[np.linalg.norm(spans, axis=1).argmax()]
        e1 = e1 / np.linalg.norm(e1)
        P = spans @ np.stack([e1, np.cross([0.0, 0.0, 1.0], e1)], axis=1)
        fit = np.linalg.inv(P.T @ P + regularisation * np.eye(2)) @ P.T
        for row, expected in ((x[i], fit[0]), (y[i], fit[1])):
            np.testing.assert_allclose(row[ring], expected, atol=1e-9)
            assert row[i] == pytest.approx(-expected.sum(), abs=1e-9)
            assert np.count_nonzero(row) <= len(ring) + 1


def test_linear_functions_in_the_plane_are_met_exactly_and_turn_counter_clockwise():
    mesh = plane(8)
    inner, outer = products(mesh, mesh.vertices[:, 0], 3 * mesh.vertices[:, 1])
    np.testing.assert_allclose(inner, 0, atol=1e-4)
    np.testing.assert_allclose(outer, 3, rtol=1e-4)


def test_gradients_of_the_coordinates_of_a_sphere():
    mesh = sphere(3)
    inner, outer = products(mesh, mesh.vertices[:, 0], mesh.vertices[:, 1])
    x, y, z = mesh.vertices.T
    np.testing.assert_allclose(inner, -x * y, atol=0.03)
    np.testing.assert_allclose(outer, z, atol=0.03)


def test_other_orientation_other_sign():
    mesh = blob(2)
    inside_out = replace(mesh, faces=mesh.faces[:, ::-1])
    f, g = np.random.default_rng(0).normal(size=(2, mesh.n_vertices))
    (inner, outer), (same, opposite) = products(mesh, f, g), products(inside_out, f, g)
    np.testing.assert_allclose(same, inner, atol=1e-6 * np.abs(inner).max())
    np.testing.assert_allclose(opposite, -outer, atol=1e-6 * np.abs(outer).max())


def test_motion_changes_nothing_and_numbering_only_the_order():
    mesh = blob(2)
    moved = replace(mesh, vertices=mesh.vertices @ rotation(5).T + np.array([1.0, 2.0, 3.0]))
    np.testing.assert_allclose(components(moved), components(mesh), atol=1e-7)
    order = np.random.default_rng(0).permutation(mesh.n_vertices)
    renumbered = replace(mesh, vertices=mesh.vertices[order], faces=np.argsort(order)[mesh.faces])
    before = [matrix[np.ix_(order, order)] for matrix in components(mesh)]
    np.testing.assert_allclose(components(renumbered), before, atol=1e-7)


@pytest.mark.parametrize("mesh", [blob(2), plane(6)], ids=["closed", "with boundary"])
def test_mirror_transposes_the_pattern(mesh):
    arrays = VertexGradients(1e-5)(Operators(mesh))
    for values in arrays["values"]:
        matrix = sparse.csr_array((values, arrays["indices"], arrays["indptr"])).toarray()
        other = sparse.csr_array((values[arrays["mirror"]], arrays["indices"], arrays["indptr"])).toarray()
        np.testing.assert_array_equal(other, matrix.T)


@pytest.mark.parametrize("wrong", [0.0, -1.0, float("nan")])
def test_settings_out_of_range_are_refused(wrong):
    with pytest.raises(ConfigError, match="wanted"):
        VertexGradients(wrong)
