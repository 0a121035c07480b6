"""Compact features: distances between vertices, within a shape and across, are those of the features."""

from __future__ import annotations

import numpy as np
import pytest

from csm.errors import ConfigError
from csm.viewer.features import COMPONENTS, UNKNOWN, CompactFeatures, compact_features

RNG = np.random.default_rng(0)


def distances(compact: CompactFeatures, i: int, j: int) -> np.ndarray:
    """Measure all vertices of shape i against all of shape j, as the page does."""
    a, b = (compact.codes[k].astype(np.float64) * compact.steps for k in (i, j))
    return np.linalg.norm(a[:, None] - b, axis=2)


def test_distances_within_and_across_shapes_are_kept() -> None:
    mixing = RNG.normal(size=(10, 90))
    shapes = [RNG.normal(size=(n, 10)) @ mixing + 7 for n in (60, 80)]
    compact = compact_features(shapes)
    assert [c.shape for c in compact.codes] == [(60, COMPONENTS), (80, COMPONENTS)]
    assert compact.kept == pytest.approx(1)
    for i, j in ((0, 0), (0, 1), (1, 1)):
        exact = np.linalg.norm(shapes[i][:, None] - shapes[j], axis=2)
        np.testing.assert_allclose(distances(compact, i, j), exact, atol=0.02 * exact.max())


def test_what_is_left_out_is_said_and_lies_along_the_directions_of_least_variance() -> None:
    spread = np.concatenate([np.full(COMPONENTS, 10.0), np.full(20, 0.1)])
    shapes = [RNG.normal(size=(500, 36)) * spread, RNG.normal(size=(500, 36)) * spread]
    compact = compact_features(shapes)
    variances = np.concatenate(shapes).var(axis=0)
    assert compact.kept == pytest.approx(variances[:COMPONENTS].sum() / variances.sum(), abs=1e-4)
    few = compact_features(shapes, components=4)
    assert few.codes[0].shape == (500, 4)
    assert few.kept < 0.5


def test_fewer_columns_than_components_and_features_that_are_all_alike() -> None:
    compact = compact_features([[[1.0, 2.0], [1.0, 2.0]], [[1.0, 2.0]]])
    assert (distances(compact, 0, 1) == 0).all()
    assert compact.steps.shape == (2,)
    assert np.isfinite(compact.steps).all()


def test_a_vertex_without_features_is_unknown_and_the_others_do_not_notice() -> None:
    features = RNG.normal(size=(40, 5))
    holed = np.insert(features, 3, np.nan, axis=0)
    compact, whole = compact_features([holed, features]), compact_features([features, features])
    assert (compact.codes[0][3] == UNKNOWN).all()
    assert compact.codes[1].min() > UNKNOWN
    np.testing.assert_array_equal(np.delete(compact.codes[0], 3, axis=0), whole.codes[0])


@pytest.mark.parametrize("shapes", [[], [(4, 3), (4, 2)], [(4,)], [(4, 0)]])
def test_features_that_cannot_be_compared_are_refused(shapes: list[tuple[int, ...]]) -> None:
    with pytest.raises(ConfigError, match="same number of columns"):
        compact_features([np.zeros(shape) for shape in shapes])
