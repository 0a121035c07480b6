from __future__ import annotations

import numpy as np
import pytest

from csm.errors import ConfigError, DataError
from csm.matching.errors import map_errors
from csm.matching.maps import VertexMap
from csm.mesh.shape import Mesh
from csm.operators.geodesic import geodesics
from tests.shapes import blob, plane, sphere

MESH = blob(2)
N = MESH.n_vertices


@pytest.mark.parametrize("distance", ["exact", "heat", "edge"])
@pytest.mark.parametrize("normaliser", ["diameter", "sqrt_area"])
def test_errors_are_entries_of_whole_rows_of_distances(distance, normaliser):
    rng = np.random.default_rng(0)
    truth, found = rng.integers(0, N, (2, 40))
    errors = map_errors(VertexMap(found, N), truth, MESH, distance, normaliser)
    surface = geodesics(MESH, distance)
    by = surface.diameter() if normaliser == "diameter" else np.sqrt(MESH.area)
    rows = surface.rows(truth)
    np.testing.assert_allclose(errors * by, rows[np.arange(40), found], rtol=1e-6, atol=1e-9)


def test_the_right_map_has_no_error_and_scale_plays_no_part():
    turn = np.random.default_rng(1).permutation(N)
    np.testing.assert_array_equal(map_errors(VertexMap(turn, N), VertexMap(turn, N), MESH), 0)
    other = np.roll(turn, 1)
    large = Mesh(1000 * MESH.vertices, MESH.faces)
    np.testing.assert_allclose(
        map_errors(VertexMap(other, N), turn, MESH, "edge"), map_errors(VertexMap(other, N), turn, large, "edge")
    )
    assert map_errors(VertexMap(other, N), turn, MESH, "edge").max() <= 1.0 + 1e-9


def test_what_is_unknown_has_no_error():
    errors = map_errors(VertexMap(np.array([3, -1, 5, 7]), N), [3, 4, -1, 7], MESH, "edge")
    assert np.isnan(errors).tolist() == [False, True, True, False]


def test_what_no_path_joins_is_as_far_as_the_diameter():
    ball = sphere(2)
    both = Mesh(np.vstack([ball.vertices, ball.vertices + 9]), np.vstack([ball.faces, ball.faces + 162]))
    assert map_errors(VertexMap(np.array([0, 0]), 324), [162, 0], both, "edge").tolist() == [1.0, 0.0]


def test_what_does_not_fit_is_named():
    found = VertexMap(np.arange(5), N, "a", "b")
    with pytest.raises(DataError, match="a -> b: a map of 5 to 162 vertices, a truth of 4 to 162"):
        map_errors(found, np.arange(4), MESH)
    with pytest.raises(DataError, match=r"a truth of 5 to 9 .* do not fit"):
        map_errors(found, VertexMap(np.arange(5), 9), MESH)
    with pytest.raises(DataError, match="and a mesh of 225 do not fit"):
        map_errors(found, np.arange(5), plane())
    with pytest.raises(DataError, match=r"the truth of a -> b: .* integers"):
        map_errors(found, np.arange(5.0), MESH)
    with pytest.raises(ConfigError, match="normaliser=area; wanted diameter or sqrt_area"):
        map_errors(found, np.arange(5), MESH, normaliser="area")
    with pytest.raises(ConfigError, match="geodesic method"):
        map_errors(found, np.arange(5), MESH, "straight")
