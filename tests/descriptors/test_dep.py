from __future__ import annotations

import tracemalloc
from dataclasses import replace

import networkx
import numpy as np
import pytest

from csm.descriptors.dep import DEP, closeness
from csm.errors import ConfigError
from csm.mesh.shape import Mesh
from csm.operators import Operators
from csm.operators.geodesic import geodesics
from tests.descriptors.invariances import CHECKS, mirrored
from tests.shapes import blob


def dense(distances: np.ndarray, mass: np.ndarray, delta: float, c: float) -> np.ndarray:
    """One column, in double precision and by solving the system."""
    distances = distances / distances.max()
    process = np.where(distances <= delta, 1 - distances, 0) * mass
    radius = np.abs(np.linalg.eigvals(process)).max()
    g = np.linalg.solve(np.eye(len(mass)) - c / radius * process, np.ones(len(mass)))
    return (g - g.min()) / (g.max() - g.min())


def edge_distances(mesh: Mesh) -> np.ndarray:
    graph = networkx.Graph()
    for face in mesh.faces:
        for a, b in zip(face, np.roll(face, 1), strict=True):
            graph.add_edge(a, b, weight=np.linalg.norm(mesh.vertices[a] - mesh.vertices[b]))
    lengths = dict(networkx.all_pairs_dijkstra_path_length(graph))
    return np.array([[lengths[a][b] for b in range(mesh.n_vertices)] for a in range(mesh.n_vertices)])


def heat_distances(mesh: Mesh) -> np.ndarray:
    rows = geodesics(mesh, "heat").rows(np.arange(mesh.n_vertices))
    return (rows + rows.T) / 2


def biharmonic_distances(mesh: Mesh, k: int) -> np.ndarray:
    spectrum = Operators(mesh).lbo(k)
    squared = np.zeros((mesh.n_vertices, mesh.n_vertices))
    for value, vector in list(zip(spectrum.evals, spectrum.evecs.T, strict=True))[1:]:
        squared += (vector[:, None] - vector) ** 2 / value**2
    return np.sqrt(squared)


@pytest.mark.parametrize("c", [0.1, 0.7])
@pytest.mark.parametrize("distance", ["edge", "heat", "biharmonic"])
def test_against_a_dense_solve(distance, c):
    mesh = blob(2).unit_area()
    distances = {
        "edge": lambda: edge_distances(mesh),
        "heat": lambda: heat_distances(mesh),
        "biharmonic": lambda: biharmonic_distances(mesh, 30),
    }[distance]()
    descriptor = DEP(n_scales=6, smallest=0.05, c=c, distance=distance, k=30)
    features = descriptor(mesh)
    for column, delta in enumerate(np.linspace(0.05, 1, 6)):
        expected = dense(distances, Operators(mesh).mass, delta, c)
        np.testing.assert_allclose(features.values[:, column], expected, atol=1e-5)
    assert features.columns[0] == "delta=0.050"


@pytest.mark.parametrize(("c", "tolerance"), [(0.1, 1e-6), (0.1, 0.5), (0.9, 1e-3)])
def test_number_of_steps_is_the_least_that_meets_the_tolerance(c, tolerance):
    terms = DEP(c=c, tolerance=tolerance).terms
    rest = [c**m / (1 - c) for m in (terms, terms - 1)]  # of the series 1 + c + c^2 + ..., relative to its first term
    assert rest[0] <= tolerance * (1 + 1e-9)
    assert rest[1] > tolerance


def test_columns_run_from_0_to_1():
    values = DEP()(blob(3)).values
    np.testing.assert_array_equal(values.min(axis=0), 0)
    np.testing.assert_array_equal(values.max(axis=0), 1)


@pytest.mark.parametrize("check", CHECKS)
@pytest.mark.parametrize("distance", ["edge", "biharmonic"])
def test_invariance(distance, check):
    check(DEP(n_scales=4, distance=distance, k=20))


def test_mirror_and_scale_change_nothing_whatever_the_unit():
    before = DEP(n_scales=4)(blob(3)).values
    changed = mirrored(replace(blob(3), vertices=3.0 * blob(3).vertices))
    for shape in (changed, Operators(changed, unit_area=False)):
        np.testing.assert_allclose(DEP(n_scales=4)(shape).values, before, atol=1e-6)


def test_nothing_passes_between_parts_that_no_path_joins():
    one = blob(2)
    aside = one.vertices + np.array([10.0, 0.0, 0.0])
    both = Mesh(np.vstack([one.vertices, aside]), np.vstack([one.faces, one.faces + one.n_vertices]))
    alone = DEP(n_scales=4)(one).values
    np.testing.assert_allclose(DEP(n_scales=4)(both).values, np.vstack([alone, alone]), atol=1e-5)


@pytest.mark.parametrize("faces", [[[0, 1, 2]], [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]])
def test_where_all_points_are_alike_every_value_is_zero(faces):
    corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1.0]])
    mesh = Mesh(corners[: np.max(faces) + 1], np.array(faces))
    np.testing.assert_allclose(DEP(n_scales=2, smallest=0.5)(mesh).values, 0)


def test_one_matrix_in_single_precision_is_all_that_is_held():
    n = 3000
    points = np.random.default_rng(0).random(n)
    rows = (np.abs(points[i : i + 200, None] - points) for i in range(0, n, 200))
    tracemalloc.start()
    kernel = closeness(rows, n)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1.5 * 4 * n**2
    np.testing.assert_allclose(kernel, 1 - np.abs(points[:, None] - points) / np.ptp(points), atol=1e-6)


@pytest.mark.parametrize(
    "wrong",
    [
        {"n_scales": 0},
        {"smallest": 0.0},
        {"smallest": 0.5, "largest": 0.4},
        {"largest": 1.1},
        {"c": 1.0},
        {"tolerance": 0.0},
        {"k": 1},
        {"distance": "exact"},
    ],
)
def test_settings_out_of_range_are_refused(wrong):
    with pytest.raises(ConfigError, match=r"wanted|one of"):
        DEP(**wrong)
