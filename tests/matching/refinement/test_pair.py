"""The features of two shapes at one scale."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from csm.errors import ConfigError
from csm.matching.refinement.pair import Pair
from tests.matching.pairs import described
from tests.shapes import blob, sphere


def two(store, width: int = 4, scale: float = 1.0, shift: float = 0.0):
    rng = np.random.default_rng(0)
    meshes = blob(2), sphere(1)
    return [described(m, store, scale * rng.normal(size=(m.n_vertices, width)) + shift) for m in meshes]


@pytest.mark.parametrize("width", [1, 4, 80])
def test_features_are_centred_with_a_total_variance_of_one(store, width):
    pair = Pair.of(*two(store, width, 30.0, 5.0))
    weights = [e.spectrum.mass / e.spectrum.mass.sum() / 2 for e in (pair.source, pair.target)]
    rows = [f.numpy().astype(float) for f in (pair.features_source, pair.features_target)]
    mean = sum(w @ r for w, r in zip(weights, rows, strict=True))
    variance = sum(w @ (r**2).sum(1) for w, r in zip(weights, rows, strict=True))
    assert np.abs(mean).max() < 1e-5
    assert variance == pytest.approx(1, rel=1e-4) if width <= 64 else 0.8 < variance < 1
    assert rows[0].shape[1] == rows[1].shape[1] == min(width, 64)


def test_axes_turn_features_and_change_no_ratio_of_distances(store):
    source, target = two(store)
    pair = Pair.of(source, target)
    before = cdist(source.features.numpy(), target.features.numpy())
    after = cdist(pair.features_source.numpy(), pair.features_target.numpy())
    np.testing.assert_allclose(after / after.mean(), before / before.mean(), rtol=1e-3)


def test_scale_and_shift_of_the_features_change_nothing(store):
    one, other = (Pair.of(*two(store, 4, *change)) for change in ((1.0, 0.0), (1000.0, 7.0)))
    products = [p.features_source @ p.features_target.T for p in (one, other)]  # signs of axes are free
    np.testing.assert_allclose(*products, atol=1e-3)


def test_features_without_variance_are_zero(store):
    mesh = blob(1)
    flat = described(mesh, store, np.full((mesh.n_vertices, 2), 3.0))
    assert (Pair.of(flat, flat).features_source == 0).all()


def test_the_reverse_exchanges_both(store):
    pair = Pair.of(*two(store))
    assert pair.reversed.source is pair.target
    assert pair.reversed.features_target is pair.features_source
    assert pair.reversed.k == pair.k == 10  # the sphere has 42 vertices
    sampled = pair.reversed.sampled(7)
    assert sampled.features_source.shape[0] == sampled.features_target.shape[0] == 7
    np.testing.assert_array_equal(sampled.features_target, pair.features_source[sampled.target.at])


def test_features_that_cannot_be_compared_are_refused(store):
    source, target = two(store)
    with pytest.raises(ConfigError, match="descriptors of 4 and 3 columns"):
        Pair.of(source, described(target.mesh, store, target.features.numpy()[:, :3]))
    broken = target.features.numpy().copy()
    broken[0, 0] = np.nan
    with pytest.raises(ConfigError, match="not finite"):
        Pair.of(source, described(target.mesh, store, broken))
