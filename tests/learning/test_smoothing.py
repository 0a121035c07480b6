from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
import torch
from torch.nn import functional

from csm.learning.smoothing import TIME, smoothed
from csm.mesh.shape import Mesh
from csm.operators.laplacian import stiffness, vertex_areas
from tests.shapes import sphere


def stretched(subdivisions):
    ball = sphere(subdivisions)
    return Mesh(ball.vertices * [1.0, 2.0, 0.7], ball.faces, "body")


@pytest.fixture(scope="module")
def body():
    return stretched(3)


def unit(rows):
    return functional.normalize(torch.as_tensor(rows), dim=1)


def random_rows(n, k=70):
    return unit(np.random.default_rng(0).standard_normal((n, k)))


def test_it_is_the_filter_over_all_eigenpairs(body):
    areas, rows = vertex_areas(body), random_rows(body.n_vertices)
    values, functions = scipy.linalg.eigh(stiffness(body).toarray(), np.diag(areas))
    filtered = functions / (1 + (TIME * areas.sum() * values) ** 2) @ functions.T @ (areas[:, None] * rows.numpy())
    torch.testing.assert_close(smoothed(rows, body), unit(filtered), atol=1e-9, rtol=0)


def test_it_takes_noise_out_of_a_smooth_map():
    body = stretched(5)
    smooth = unit(np.column_stack([np.ones(body.n_vertices), body.vertices]))
    noise = 0.02 * torch.from_numpy(np.random.default_rng(1).standard_normal(smooth.shape))
    before, after = ((x - smooth).norm() for x in (unit(smooth + noise), smoothed(unit(smooth + noise), body)))
    assert after < 0.3 * before
    assert (smoothed(smooth, body) - smooth).norm() < 0.05 * (before + after)


def test_it_does_not_depend_on_the_size_of_the_mesh(body):
    rows = random_rows(body.n_vertices)
    large = Mesh(1000 * body.vertices, body.faces, "large")
    torch.testing.assert_close(smoothed(rows, large), smoothed(rows, body), atol=1e-9, rtol=0)


def test_a_vertex_without_faces_keeps_its_row(body):
    more = Mesh(np.vstack([body.vertices, [[5.0, 5.0, 5.0]]]), body.faces, "more")
    rows = random_rows(more.n_vertices)
    found = smoothed(rows, more)
    torch.testing.assert_close(found[-1], rows[-1])
    torch.testing.assert_close(found[:-1], smoothed(rows[:-1], body))


def test_type_of_the_rows_stays(body):
    assert smoothed(random_rows(body.n_vertices).float(), body).dtype == torch.float32
