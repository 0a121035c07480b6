"""Arrays of pixels: png files and sheets of many pictures."""

from __future__ import annotations

import io
import os
from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from csm.errors import ConfigError
from csm.mesh.io import atomic_path

Picture: TypeAlias = NDArray[np.uint8]

_LABEL_COLOR = (70, 74, 82)


def png_bytes(picture: Picture) -> bytes:
    """Encode a picture (H, W, 3 or 4) as png; the same picture gives the same bytes."""
    buffer = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(picture)).save(buffer, format="png")
    return buffer.getvalue()


def save_png(path: str | os.PathLike[str], picture: Picture) -> None:
    """Write a picture (H, W, 3 or 4) as png; the file is there whole or not at all."""
    with atomic_path(path) as temporary:
        temporary.write_bytes(png_bytes(picture))


def on_white(picture: Picture) -> Picture:
    """Lay a picture with alpha on white paper; shape (H, W, 3)."""
    if picture.shape[-1] == 3:
        return picture
    alpha = picture[..., 3:] / 255.0
    return np.round(picture[..., :3] * alpha + 255 * (1 - alpha)).astype(np.uint8)


def contact_sheet(
    pictures: Sequence[Picture], labels: Sequence[str] | None = None, columns: int = 5, *, gap: int = 8
) -> Picture:
    """Put pictures on one white sheet, row by row, each with its label below.

    Parameters
    ----------
    pictures
        One or more of shape (h, w, 3 or 4); smaller ones are centred in a cell as large as the largest.
    labels
        One text per picture; none by default.
    columns
        Pictures per row.
    gap
        Pixels between the cells.

    Returns
    -------
    Picture
        Shape (H, W, 3).

    Raises
    ------
    ConfigError
        If there is no picture, no column, or not one label per picture.
    """
    labels = [""] * len(pictures) if labels is None else list(labels)
    if not pictures or columns < 1 or len(labels) != len(pictures):
        raise ConfigError(f"sheet of {len(pictures)} pictures with {len(labels)} labels in {columns} columns")
    height, width = (max(p.shape[k] for p in pictures) for k in (0, 1))
    font_size = max(12, height // 24)
    strip = int(1.6 * font_size) if any(labels) else 0
    columns = min(columns, len(pictures))
    rows = -(-len(pictures) // columns)
    step_x, step_y = width + gap, height + strip + gap
    sheet = Image.new("RGB", (columns * step_x + gap, rows * step_y + gap), "white")
    pen, font = ImageDraw.Draw(sheet), ImageFont.load_default(font_size)
    for i, (picture, label) in enumerate(zip(pictures, labels, strict=True)):
        x, y = gap + i % columns * step_x, gap + i // columns * step_y
        corner = (x + (width - picture.shape[1]) // 2, y + (height - picture.shape[0]) // 2)
        sheet.paste(Image.fromarray(on_white(picture)), corner)
        pen.text((x + width / 2, y + height + strip / 2), label, _LABEL_COLOR, font, anchor="mm")
    return np.asarray(sheet)
