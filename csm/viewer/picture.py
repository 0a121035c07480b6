"""Arrays of pixels, and their encoding as png."""

from __future__ import annotations

import io
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from PIL import Image

Picture: TypeAlias = NDArray[np.uint8]


def png_bytes(picture: Picture) -> bytes:
    """Encode a picture (H, W, 3 or 4) as png; the same picture gives the same bytes."""
    buffer = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(picture)).save(buffer, format="png")
    return buffer.getvalue()
