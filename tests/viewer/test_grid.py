"""A grid has a panel per mesh, dots where the vertices are, and one scale for all colours."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib import colormaps

from csm.errors import ConfigError
from csm.mesh.shape import Mesh
from csm.viewer.camera import View
from csm.viewer.figures import figure_to_array
from csm.viewer.grid import DISTANCE_COLORMAP, Panel, Scale, locate, scalar_grid
from csm.viewer.render import render
from tests.shapes import sphere

VIEW = View(up="y", elevation=0)
SIZE = (80, 100)
BALL = sphere(3)
FRONT, BACK = int(BALL.vertices[:, 2].argmax()), int(BALL.vertices[:, 2].argmin())
SCALE = Scale("distance", high=2.0)


def panels(count: int, mark: int | None = None) -> list[Panel]:
    return [Panel(BALL, BALL.vertices[:, 1] + 1, mark)] * count


def test_vertices_are_located_where_they_are_drawn():
    top, right = int(BALL.vertices[:, 1].argmax()), int(BALL.vertices[:, 0].argmax())
    where, seen = locate(BALL, [FRONT, BACK, top, right], VIEW, SIZE)
    np.testing.assert_allclose(where[0], (40, 50), atol=1)
    np.testing.assert_allclose(where[1], (40, 50), atol=1)
    assert where[2][1] < 20
    assert where[3][0] > 70
    assert seen.tolist() == [True, False, True, True]


def test_there_is_a_panel_per_mesh_and_labels_for_all():
    rows = {name: panels(2) for name in ("HKS", "WKS", "ACD")}
    figure = scalar_grid(rows, ["one", "two"], SCALE, view=VIEW, size=SIZE, blocks=2)
    pictures = [axes for axes in figure.axes if axes.get_images()]
    texts = [text.get_text() for text in figure.texts]
    assert len(pictures) == 6
    assert {name: texts.count(name) for name in ("HKS", "WKS", "ACD", "one", "two")} == {
        "HKS": 1,
        "WKS": 1,
        "ACD": 1,
        "one": 2,  # once per block
        "two": 2,
    }
    bar = figure.axes[-1]
    assert bar.get_xlabel() == "distance"
    assert bar.get_xlim() == (0, 2)


def test_panels_and_labels_do_not_overlap():
    figure = scalar_grid(
        {name: panels(3) for name in "abcde"}, ["left hand", "knee", "head"], SCALE, view=VIEW, size=SIZE, blocks=2
    )
    figure.draw_without_rendering()
    boxes = [axes.get_window_extent() for axes in figure.axes] + [text.get_window_extent() for text in figure.texts]
    boxes = [box.padded(-1) for box in boxes]
    assert not [(i, j) for i, a in enumerate(boxes) for j, b in enumerate(boxes[:i]) if a.overlaps(b)]
    whole = figure.bbox
    assert all(whole.x0 <= b.x0 and b.x1 <= whole.x1 and whole.y0 <= b.y0 and b.y1 <= whole.y1 for b in boxes)


def test_a_panel_shows_its_pixels_one_to_one_and_a_white_dot_at_the_mark():
    plain = scalar_grid({"row": panels(1)}, ["c"], SCALE, view=View("y", 0, 0, height=2.2), size=SIZE)
    marked = scalar_grid({"row": panels(1, FRONT)}, ["c"], SCALE, view=View("y", 0, 0, height=2.2), size=SIZE)
    before, after = (figure_to_array(figure, dpi=200).astype(int) for figure in (plain, marked))
    changed = np.argwhere(np.abs(before - after).sum(axis=2) > 30)
    assert 30 < len(changed) < 300
    row, column = np.round(changed.mean(axis=0)).astype(int)
    assert (after[row, column] > 240).all()
    box = plain.axes[0].get_position()
    height, width = before.shape[:2]
    assert abs(column / width - 0.5 * (box.x0 + box.x1)) < 0.02
    assert abs(1 - row / height - 0.5 * (box.y0 + box.y1)) < 0.02


def test_a_hidden_vertex_is_a_ring():
    figures = [scalar_grid({"row": panels(1, v)}, ["c"], SCALE, view=VIEW, size=SIZE) for v in (FRONT, BACK)]
    assert [figure.axes[0].get_lines()[0].get_markerfacecolor() for figure in figures] == ["white", "none"]


def test_all_panels_have_one_scale_of_length_and_the_largest_fits():
    small = Mesh(0.5 * BALL.vertices, BALL.faces, "small")
    wide = Mesh(BALL.vertices * (3.0, 1.0, 1.0), BALL.faces, "wide")
    row = [Panel(m, np.zeros(m.n_vertices)) for m in (small, BALL, wide)]
    figure = scalar_grid({"row": row}, ["a", "b", "c"], SCALE, view=VIEW, size=SIZE)
    widths = [(np.asarray(a.get_images()[0].get_array()).min(axis=2) < 250).any(axis=0).sum() for a in figure.axes[:3]]
    assert widths[1] / widths[0] == pytest.approx(2, rel=0.15)
    assert widths[2] / widths[1] == pytest.approx(3, rel=0.1)
    assert 0.9 * SIZE[0] < widths[2] < SIZE[0]


def test_near_is_bright_and_lightness_falls_all_the_way():
    rgb = colormaps[DISTANCE_COLORMAP](np.linspace(0, 1, 64))[:, :3]
    lightness = rgb @ (0.2126, 0.7152, 0.0722)
    assert (np.diff(lightness) < 0).all()
    top, bottom = (
        render(BALL, colormaps[DISTANCE_COLORMAP](np.full(BALL.n_vertices, x))[:, :3], size=SIZE) for x in (0.0, 1.0)
    )
    assert top[50, 40].sum() > bottom[50, 40].sum() + 100


def test_rows_must_be_as_long_as_the_columns():
    with pytest.raises(ConfigError, match=r"rows \['HKS'\] in 1 blocks; wanted 2 panels"):
        scalar_grid({"HKS": panels(1)}, ["one", "two"], SCALE, view=VIEW)
