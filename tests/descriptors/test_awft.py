from __future__ import annotations

import numpy as np
import pytest

from csm.descriptors.awft import AWFT
from csm.descriptors.windowed import surface_functions, windowed_energies
from csm.errors import ConfigError
from csm.operators import Operators
from tests.descriptors.invariances import CHECKS, assert_close, mirrored
from tests.shapes import blob


def blocks(descriptor: AWFT, mesh) -> np.ndarray:
    """The descriptor with its columns taken apart: (N, widths, isotropic and (angle, strength), functions)."""
    values = descriptor(mesh).values
    return values.reshape(len(values), len(descriptor.taus), -1, len(descriptor.functions))


@pytest.mark.parametrize("check", CHECKS)
def test_invariances(check):
    check(AWFT(alphas=(100.0,), degrees=(45.0, 135.0), k=30))


def test_published_sizes_and_order_of_the_columns():
    columns = AWFT().columns
    assert len(columns) == 100
    assert columns[0] == "tau=0.002 isotropic (alpha=100) geovec3"
    assert columns[49] == "tau=0.002 180deg alpha=300 constant"
    assert columns[50 + 5 * (2 + 1) + 2] == "tau=0.05 45deg alpha=300 shape_index"


def test_every_column_is_the_energy_of_its_name():
    operators, k = Operators(blob(2)), 30
    features = AWFT(k=k)(operators)
    for alpha, angle, theta in ((100.0, 45, np.pi / 4), (300.0, 180, 0.0)):
        f = surface_functions(operators, ["shape_index"], k, spline_shift=0.0, index_sweeps=10)
        energy = windowed_energies(operators.albo(alpha, theta, k), f, [0.05])[:, 0, 0]
        column = features.values[:, features.columns.index(f"tau=0.05 {angle}deg alpha={alpha:g} shape_index")]
        np.testing.assert_allclose(column, energy / np.linalg.norm(energy), rtol=1e-9)


def test_each_laplacian_is_solved_once(monkeypatch):
    asked = []
    honest = Operators._spectrum
    monkeypatch.setattr(
        Operators,
        "_spectrum",
        lambda self, kind, params, solve: (asked.append(str(params)), honest(self, kind, params, solve))[1],
    )
    AWFT(alphas=(100.0,), degrees=(0.0, 90.0, 180.0), k=20)(blob(2))
    assert len(set(asked)) == 3


def test_isotropic_columns_may_come_once():
    operators = Operators(blob(2))
    twice, once = blocks(AWFT(k=30), operators), blocks(AWFT(k=30, duplicates=False), operators)
    assert (twice.shape[2], once.shape[2]) == (10, 9)
    np.testing.assert_array_equal(twice[:, :, 0], twice[:, :, 1])
    np.testing.assert_allclose(twice[:, :, 1:], once, rtol=1e-12)


def test_mirror_image_exchanges_45_and_135_degrees():
    descriptor, mesh = AWFT(k=30), blob(3)
    original, image = blocks(descriptor, mesh), blocks(descriptor, mirrored(mesh))
    exchanged = original[:, :, [0, 1, 6, 7, 4, 5, 2, 3, 8, 9]]
    assert_close(image, exchanged, 1e-6)
    assert np.abs(image - original).max() > 0.01 * np.abs(original).max()


@pytest.mark.parametrize(
    "wrong", [{"k": 1}, {"alphas": ()}, {"alphas": (0.0,)}, {"taus": (-1.0,)}, {"degrees": ()}, {"index_sweeps": -1}]
)
def test_settings_out_of_range_are_refused(wrong):
    with pytest.raises(ConfigError, match="wanted"):
        AWFT(**wrong)
