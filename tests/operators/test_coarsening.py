from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse.csgraph import shortest_path

from csm.mesh.shape import Mesh
from csm.mesh.topology import edge_graph
from csm.operators.coarsening import coarsen
from tests.shapes import blob, plane, sphere, torus


@pytest.mark.parametrize("mesh", [sphere(4), torus(), plane(30), blob(4)], ids=lambda mesh: mesh.name)
def test_interpolation_is_a_partition_of_unity_and_exact_at_the_seeds(mesh: Mesh):
    coarse = coarsen(mesh)
    up = coarse.interpolation
    assert up.shape == (mesh.n_vertices, len(coarse.seeds))
    assert up.data.min() > 0
    assert np.diff(up.indptr).max() <= 3
    np.testing.assert_allclose(up.sum(axis=1), 1.0)
    np.testing.assert_allclose(up[coarse.seeds].toarray(), np.eye(len(coarse.seeds)), atol=1e-12)


def test_seeds_are_spread_evenly():
    mesh = sphere(4)
    seeds = coarsen(mesh).seeds
    hops = shortest_path(edge_graph(mesh.vertices, mesh.faces), unweighted=True, indices=seeds)
    assert hops[:, seeds][~np.eye(len(seeds), dtype=bool)].min() == 3  # none within two edges of another
    assert hops.min(axis=0).max() <= 2  # and no more would fit


def test_no_more_seeds_than_are_wanted():
    mesh = sphere(4)
    few, many = (len(coarsen(mesh, at_most).seeds) for at_most in (60, 10_000))
    assert few <= 60 < many


def test_smooth_functions_are_interpolated():
    mesh = sphere(5)
    coarse = coarsen(mesh)
    errors = mesh.vertices - coarse.interpolation @ mesh.vertices[coarse.seeds]
    assert np.abs(errors).max() < 0.02  # the sag of the coarse faces


def test_sheets_that_lie_on_each_other_stay_apart():
    one = plane(20)
    n = one.n_vertices
    above = one.vertices + np.array([0, 0, 1e-4])
    both = Mesh(np.concatenate([one.vertices, above]), np.concatenate([one.faces, one.faces + n]), "two sheets")
    coarse = coarsen(both)
    lower = coarse.seeds < n
    assert coarse.interpolation[:n][:, ~lower].nnz == 0
    assert coarse.interpolation[n:][:, lower].nnz == 0


def test_a_component_of_one_cell_takes_the_value_of_its_seed():
    big, small = sphere(3), Mesh(np.eye(3) + 5.0, np.array([[0, 1, 2]]), "face")
    n = big.n_vertices
    both = Mesh(np.concatenate([big.vertices, small.vertices]), np.concatenate([big.faces, small.faces + n]), "both")
    rows = coarsen(both).interpolation[n:].toarray()
    assert (rows.max(axis=1) == 1).all()
    assert (rows.argmax(axis=1) == rows[0].argmax()).all()
