from __future__ import annotations

import numpy as np

from csm.data.packed import pack, unpack


def test_each_shape_comes_back_to_half_a_step_of_its_own():
    rng = np.random.default_rng(0)
    shapes = rng.normal(size=(3, 50, 3)) * np.array([1.0, 0.01, 30.0])[:, None, None] + 7
    arrays = pack(shapes)
    assert arrays["differences"].dtype == np.uint16
    for k, shape in enumerate(shapes):
        extent = (shape.max(axis=0) - shape.min(axis=0)).max()
        assert abs(unpack(arrays, k) - shape).max() <= 0.5001 * extent / 65535
