"""Sheets and png files hold the very pixels they were given."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from csm.errors import ConfigError
from csm.viewer.picture import contact_sheet, png_bytes, save_png
from csm.viewer.render import render
from tests.shapes import sphere


def test_contact_sheet_puts_pictures_in_rows() -> None:
    pictures = [np.full((10, 12, 3), value, np.uint8) for value in (10, 60, 110)]
    sheet = contact_sheet(pictures, columns=2, gap=0)
    assert sheet.shape == (20, 24, 3)
    assert (sheet[:10, :12] == 10).all()
    assert (sheet[:10, 12:] == 60).all()
    assert (sheet[10:, :12] == 110).all()
    assert (sheet[10:, 12:] == 255).all()


def test_contact_sheet_writes_labels_below_and_lays_clear_pixels_on_white() -> None:
    clear = np.zeros((40, 80, 4), np.uint8)
    sheet = contact_sheet([clear, clear[:20]], ["front", ""], columns=2, gap=0)
    assert (sheet[:40] == 255).all()
    assert sheet[40:, :80].min() < 150
    assert (sheet[40:, 80:] == 255).all()
    with pytest.raises(ConfigError, match="2 pictures with 1 labels"):
        contact_sheet([clear, clear], ["front"])


def test_png_holds_the_very_pixels(tmp_path: Path) -> None:
    picture = render(sphere(1), size=(20, 30), background="transparent")
    save_png(tmp_path / "new" / "a.png", picture)
    np.testing.assert_array_equal(np.asarray(Image.open(tmp_path / "new" / "a.png")), picture)
    assert png_bytes(picture) == (tmp_path / "new" / "a.png").read_bytes()
    assert [p.name for p in (tmp_path / "new").iterdir()] == ["a.png"]
