from __future__ import annotations

import itertools

import numpy as np
import pytest

from csm.errors import ConfigError
from csm.mesh.shape import Mesh
from csm.operators.filters import mexican_hat_filters
from csm.operators.operators import Operators
from csm.operators.stencils.wavelets import Wavelets, partition, substantial
from tests.shapes import blob


def published(mesh: Mesh, k: int, n_filters: int) -> np.ndarray:
    """The operators G_s, shape (S, N, N), step by step as the published code makes them, with the areas."""
    spectrum = Operators(mesh).lbo(k + 1)
    evals, evecs = spectrum.evals[1:], spectrum.evecs[:, 1:]
    filters = mexican_hat_filters(evals, n_filters, evals[-1])
    made = []
    for column in range(n_filters - 1, 0, -2):
        wavelets = (evecs @ np.diag(filters[:, column]) @ evecs.T @ np.diag(spectrum.mass)) ** 2
        made.append((wavelets / np.linalg.norm(wavelets, axis=0)) ** 2)
    return np.array(made)


def dense(mesh: Mesh, **parameters) -> np.ndarray:
    """The same from the arrays of the stencil; what lies outside of a patch's reach is 0."""
    arrays = Wavelets(**parameters)(Operators(mesh))
    n, n_wavelets = mesh.n_vertices, arrays["responses"].shape[1]
    made = np.zeros((n_wavelets, n, n))
    pieces = [np.split(arrays[f"{kind}s"], arrays[f"{kind}_ends"][:-1]) for kind in ("row", "column")]
    for rows, columns, extents in zip(*pieces, arrays["extents"], strict=True):
        for s, extent in enumerate(extents):
            reached = columns[:extent]
            kernel = arrays["evecs"][reached] * arrays["responses"][:, s].astype(float) @ arrays["evecs"][rows].T
            made[s][np.ix_(reached, rows)] = kernel**4
    return made / made.sum(axis=1, keepdims=True)


SMALL = {"k": 40, "n_filters": 8}


@pytest.fixture(scope="module")
def mesh() -> Mesh:
    return blob(3)


def test_without_tolerance_they_are_the_published_operators_in_which_areas_cancel(mesh):
    expected = published(mesh, **SMALL)
    np.testing.assert_allclose(expected.sum(axis=1), 1, rtol=1e-12)
    np.testing.assert_allclose(dense(mesh, tolerance=0.0, patch=50, **SMALL), expected, atol=1e-5 * expected.max())


@pytest.mark.parametrize("tolerance", [1e-3, 1e-2, 0.1])
def test_no_column_loses_more_than_the_tolerance(mesh, tolerance):
    expected = published(mesh, **SMALL)
    sparse = dense(mesh, tolerance=tolerance, patch=20, **SMALL)
    lost = np.where(sparse > 0, 0, expected).sum(axis=1)
    assert 0.1 * tolerance < lost.max() < 1.001 * tolerance
    assert (sparse > 0).mean() < 0.97
    arrays = Wavelets(tolerance=tolerance, patch=20, **SMALL)(Operators(mesh))
    np.testing.assert_allclose(arrays["dropped"].T, lost[:, arrays["rows"]], atol=1e-5)


def test_order_and_pose_do_not_matter(mesh):
    order = np.random.default_rng(0).permutation(mesh.n_vertices)
    places = np.argsort(order)
    turn, _ = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))
    turn *= np.linalg.det(turn)
    moved = Mesh(mesh.vertices[order] @ turn.T + 5, places[mesh.faces])
    parameters = {**SMALL, "tolerance": 1e-2, "patch": 40}
    there, here = dense(moved, **parameters), dense(mesh, **parameters)
    np.testing.assert_allclose(there, here[:, order][:, :, order], atol=1e-3 * here.max())


def test_wavelets_run_from_fine_to_coarse(mesh):
    arrays = Wavelets(tolerance=1e-3, **SMALL)(Operators(mesh))
    centres = np.arange(40) @ arrays["responses"] / arrays["responses"].sum(axis=0)
    assert (np.diff(centres) < 0).all()
    assert {key: value.dtype.kind for key, value in arrays.items() if key.endswith("s")} == {
        "evecs": "f",
        "responses": "f",
        "rows": "i",
        "columns": "i",
        "row_ends": "i",
        "column_ends": "i",
        "extents": "i",
    }
    assert arrays["dropped"].shape == (mesh.n_vertices, 4)


def test_a_partition_has_equal_compact_parts():
    points = np.random.default_rng(0).random((530, 2))
    parts = partition(points, 30)
    assert len(parts) == 16
    assert max(map(len, parts)) - min(map(len, parts)) <= 1
    np.testing.assert_array_equal(np.sort(np.concatenate(parts)), np.arange(530))
    spread = np.mean([points[part].std(axis=0).max() for part in parts])
    assert spread < 1.5 / 4 / np.sqrt(12), "four by four squares would have a quarter of the whole's deviation"
    assert len(partition(points, 1000)) == 1


def test_what_is_substantial_against_a_search_over_all_thresholds():
    rng = np.random.default_rng(0)
    weights = rng.random((60, 5)) ** 12
    weights[7] = 0
    weights /= weights.sum(axis=0)
    kept = substantial(weights.astype(np.float32), 0.02)
    assert weights[~kept].sum(axis=0).max() <= 0.02
    greatest = weights.max(axis=1)
    best = min(
        int((greatest > t).sum()) for t in greatest if weights[greatest <= t].sum(axis=0).max() <= 0.02
    )  # an octave has four steps, so a little more may be kept
    assert best <= kept.sum() <= best + (greatest > 2**-0.25 * np.sort(greatest)[-best]).sum() - best + 1
    assert substantial(weights.astype(np.float32), 0.0).sum() == 59


@pytest.mark.parametrize("bad", [{"k": 1}, {"n_filters": 1}, {"patch": 0}, {"tolerance": -0.1}, {"tolerance": 1.0}])
def test_bad_parameters_are_named(bad):
    with pytest.raises(ConfigError, match="wanted k >= 2"):
        Wavelets(**{**SMALL, "tolerance": 1e-3, **bad})


def test_extents_are_within_the_columns_of_their_patch(mesh):
    arrays = Wavelets(tolerance=0.05, patch=30, **SMALL)(Operators(mesh))
    sizes = [b - a for a, b in itertools.pairwise([0, *arrays["column_ends"]])]
    np.testing.assert_array_equal(arrays["extents"].max(axis=1), sizes)
