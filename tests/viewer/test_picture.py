"""A png holds the pixels that it was given."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image

from csm.viewer.picture import png_bytes


@pytest.mark.parametrize("channels", [3, 4])
def test_a_png_holds_the_pixels_and_is_the_same_every_time(channels: int) -> None:
    picture = np.random.default_rng(0).integers(0, 256, (30, 20, channels), dtype=np.uint8)
    encoded = png_bytes(picture)
    np.testing.assert_array_equal(np.asarray(Image.open(io.BytesIO(encoded))), picture)
    assert png_bytes(picture[:, :, :]) == encoded
