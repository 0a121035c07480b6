from __future__ import annotations

import numpy as np
import torch

from csm.matching import VertexMap
from csm.matching.base import Described
from csm.matching.signals import OF_MAPS, OF_REFINED, Sides, map_signals, spectral_signals
from csm.mesh.shape import Mesh
from tests.shapes import blob

BALL = blob(3)
N = BALL.n_vertices
IDENTITY = VertexMap(np.arange(N), N)


def described(mesh: Mesh = BALL) -> Described:
    return Described(mesh, torch.from_numpy(mesh.vertices))


def column(values: np.ndarray, names: tuple[str, ...], name: str) -> np.ndarray:
    return values[:, names.index(name)]


def test_the_identity_has_nothing_against_it():
    sides = Sides(described(), described(), IDENTITY, IDENTITY)
    assert not map_signals(sides).any()
    found = spectral_signals(sides, IDENTITY)
    assert (column(found, OF_REFINED, "start") == 1).all()
    for name in ("apart", "apart_all", "stretch", "commutation"):
        np.testing.assert_allclose(column(found, OF_REFINED, name), 0, atol=1e-8)


def test_signals_do_not_depend_on_the_scale_of_either_shape():
    moved = VertexMap(np.random.default_rng(0).permutation(N), N)
    back = VertexMap(np.argsort(moved.indices), N)
    large = Mesh(10 * BALL.vertices, BALL.faces, "large")
    plain = Sides(described(), described(), moved, back)
    scaled = Sides(described(large), Described(large, torch.from_numpy(BALL.vertices)), moved, back)
    scaled = Sides(Described(large, torch.from_numpy(BALL.vertices)), scaled.target, moved, back)
    np.testing.assert_allclose(map_signals(scaled), map_signals(plain), rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(spectral_signals(scaled, IDENTITY), spectral_signals(plain, IDENTITY), rtol=1e-4)


def test_a_patch_that_goes_elsewhere_stands_out():
    patch = np.flatnonzero(BALL.vertices[:, 2] > np.quantile(BALL.vertices[:, 2], 0.9))
    indices = np.arange(N)
    opposite = ((BALL.vertices[patch][:, None] + BALL.vertices) ** 2).sum(2).argmin(1)
    indices[patch] = opposite
    sides = Sides(described(), described(), VertexMap(indices, N), IDENTITY)
    signals, spectral = map_signals(sides), spectral_signals(sides, IDENTITY)
    rest = np.setdiff1d(np.arange(N), patch)
    columns = [column(signals, OF_MAPS, name) for name in ("back", "descriptor")]
    for of in (*columns, column(spectral, OF_REFINED, "apart")):
        assert np.median(of[patch]) > 5 * np.median(of[rest])
    start = column(spectral, OF_REFINED, "start")
    assert np.median(start[patch]) < 0.5 < 0.9 < np.median(start[rest])
    np.testing.assert_allclose(column(signals, OF_MAPS, "back_all"), np.median(column(signals, OF_MAPS, "back")))
