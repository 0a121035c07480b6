"""Lines of a figure can be told apart, also in grey, and figures have a canvas of their own."""

from __future__ import annotations

from itertools import pairwise

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb

from csm.viewer.style import CYCLE, line_style, new_figure


def test_lines_differ_until_colours_and_dashes_are_used_up() -> None:
    styles = {(style["color"], style["linestyle"]) for style in map(line_style, range(4 * len(CYCLE)))}
    assert len(styles) == 4 * len(CYCLE)


def test_neighbouring_colours_differ_in_lightness_or_hue() -> None:
    for a, b in pairwise(CYCLE):
        assert sum(abs(x - y) for x, y in zip(to_rgb(a), to_rgb(b), strict=True)) > 0.5


def test_a_figure_is_drawn_without_a_display() -> None:
    figure, axes = new_figure(3.0, 2.0)
    assert isinstance(figure.canvas, FigureCanvasAgg)
    assert tuple(figure.get_size_inches()) == (3.0, 2.0)
    assert not axes.spines["top"].get_visible()
    figure.canvas.draw()
