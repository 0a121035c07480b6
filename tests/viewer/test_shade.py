"""Light has a direction, creases are where the surface is deep, and the sRGB curve is the standard's."""

from __future__ import annotations

import numpy as np
import pytest

from csm.viewer.shade import creases, encoded, light, linear


def lit(*normal: float, crease: float = 0.0) -> float:
    grey = np.full((1, 3), 0.5, dtype=np.float32)
    return float(light(grey, np.array([normal], dtype=np.float32), np.array([crease], dtype=np.float32))[0, 0])


def test_light_falls_from_the_upper_left_and_creases_are_darker() -> None:
    assert lit(-0.4, 0.4, 0.8) > lit(0.4, -0.4, 0.8)
    assert lit(0, 0, 1, crease=1.0) < 0.6 * lit(0, 0, 1)
    assert lit(0, -1, 0) > 0


def test_both_sides_and_any_length_of_the_normal_are_lit_alike() -> None:
    assert lit(0.1, 0.2, 0.9) == pytest.approx(lit(-0.1, -0.2, -0.9)) == pytest.approx(lit(0.2, 0.4, 1.8))


def test_only_what_lies_behind_its_surroundings_is_in_a_crease() -> None:
    shape = (200, 200)
    depth = np.zeros(shape, dtype=np.float32)
    depth[100, 100] = 30.0
    depth[40, 40] = -30.0
    dark = creases(depth.ravel(), np.arange(depth.size), shape).reshape(shape)
    assert dark[100, 100] == 1
    assert dark[40, 40] == 0
    assert dark[150, 20] == 0


def test_an_outline_casts_no_crease() -> None:
    shape = (100, 100)
    covered = np.arange(shape[0] * shape[1]).reshape(shape)[30:70, 30:70].ravel()
    assert creases(np.full(len(covered), 50.0, np.float32), covered, shape).max() < 1e-4


def test_srgb_curve_has_the_values_of_the_standard_and_an_inverse() -> None:
    np.testing.assert_allclose(linear(np.array([0.0, 0.04045, 0.5, 1.0])), [0, 0.0031308, 0.2140411, 1], atol=1e-6)
    x = np.linspace(0, 1, 256)
    np.testing.assert_allclose(encoded(linear(x)), x, atol=1e-6)
    np.testing.assert_allclose(encoded(np.array([-0.1, 1.1])), [0, 1])
