"""Grids of rendered meshes for papers: rows and columns with labels, marked vertices, one colour bar for all."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from csm._types import BoolArray, FloatArray
from csm.errors import ConfigError
from csm.mesh.shape import Mesh
from csm.viewer.camera import View, project
from csm.viewer.colors import scalar_colors
from csm.viewer.raster import fragments_at, visible_faces
from csm.viewer.render import render

DISTANCE_COLORMAP = "viridis_r"
"""Perceptually uniform; what is near stands out bright from a dark surface."""

_DPI = 200
_HIDDEN = 0.02  # of the picture's height: a vertex that lies so far behind what is seen in its pixel is hidden
_LEFT, _TOP, _FOOT, _BETWEEN, _EDGE = 0.30, 0.42, 0.62, 0.14, 0.06  # inches around the panels
_LETTER = 0.06  # inches, a little more than the mean


@dataclass(frozen=True, eq=False)
class Panel:
    """A mesh coloured by values.

    Parameters
    ----------
    mesh
        N vertices.
    values
        Shape (N,); not a number is grey.
    mark
        A vertex that gets a dot; a ring without filling if the surface hides it.
    """

    mesh: Mesh
    values: FloatArray
    mark: int | None = None


@dataclass(frozen=True)
class Scale:
    """What the colours mean: values from 0 to `high`, and the text at the colour bar."""

    label: str
    high: float = 1.0
    colormap: str = DISTANCE_COLORMAP


def locate(mesh: Mesh, vertices: Sequence[int], view: View, size: tuple[int, int]) -> tuple[FloatArray, BoolArray]:
    """Return where vertices are in a picture of `render`, (V, 2) pixels right and down, and which are seen, (V,)."""
    width, height = size
    points = project(mesh, view, width, height)
    triangles = points[mesh.faces]
    nearest = visible_faces(triangles, width, height)
    covered = np.flatnonzero(nearest >= 0)
    depth = np.full(width * height, np.inf)
    depth[covered] = fragments_at(triangles, nearest, covered, width).depth
    asked = points[list(vertices)]
    column, row = (np.clip(asked[:, k].astype(np.int64), 0, size[k] - 1) for k in (0, 1))
    return asked[:, :2], asked[:, 2] <= depth[row * width + column] + _HIDDEN * height


def scalar_grid(
    rows: Mapping[str, Sequence[Panel]],
    columns: Sequence[str],
    scale: Scale,
    *,
    view: View,
    size: tuple[int, int] = (200, 310),
    blocks: int = 1,
) -> Figure:
    """Draw values on meshes, one labelled row per name, with a shared colour bar below.

    Parameters
    ----------
    rows
        Label -> its panels, one per column.
    columns
        Labels above the columns; room for two lines.
    scale
        Of all panels.
    view
        Where the viewer stands, for all panels; without a height the tallest mesh decides for all.
    size
        Width and height of a panel in pixels; `save_figure` at 200 dpi draws them pixel by pixel.
    blocks
        The rows are set in so many blocks side by side.

    Raises
    ------
    ConfigError
        If there is no row, or a row has not one panel per column.
    """
    wrong = [name for name, panels in rows.items() if len(panels) != len(columns)]
    if not rows or not columns or wrong or blocks < 1:
        raise ConfigError(f"grid: rows {wrong or 'none'} in {blocks} blocks; wanted {len(columns)} panels in each")
    view = _common_view([panel.mesh for panels in rows.values() for panel in panels], view, size)
    layout = _Layout(len(rows), len(columns), min(blocks, len(rows)), size)
    figure = Figure(figsize=(layout.width, layout.height), dpi=_DPI)
    FigureCanvasAgg(figure)
    for r, (name, panels) in enumerate(rows.items()):
        for c, panel in enumerate(panels):
            axes = figure.add_axes(layout.panel(r, c))
            _draw(axes, panel, scale, view, size)
            if layout.is_top(r):
                _text(figure, layout.above(r, c), textwrap.fill(columns[c], layout.letters), rotation=0)
        _text(figure, layout.beside(r), name, rotation=90, weight="bold")
    _color_bar(figure, layout, scale)
    return figure


@dataclass(frozen=True)
class _Layout:
    """Places of panels and texts, in inches from the lower left corner; as fractions of the figure where returned."""

    n_rows: int
    n_columns: int
    blocks: int
    size: tuple[int, int]

    @property
    def per_block(self) -> int:
        return -(-self.n_rows // self.blocks)

    @property
    def step(self) -> tuple[float, float]:
        return self.size[0] / _DPI, self.size[1] / _DPI

    @property
    def letters(self) -> int:
        """Letters that fit above a panel."""
        return max(8, int(self.step[0] / _LETTER))

    @property
    def width(self) -> float:
        return self.blocks * (_LEFT + self.n_columns * self.step[0]) + (self.blocks - 1) * _BETWEEN + _EDGE

    @property
    def height(self) -> float:
        return _TOP + self.per_block * self.step[1] + _FOOT

    def is_top(self, r: int) -> bool:
        return r % self.per_block == 0

    def corner(self, r: int, c: int) -> tuple[float, float]:
        block, line = divmod(r, self.per_block)
        x = block * (_LEFT + self.n_columns * self.step[0] + _BETWEEN) + _LEFT + c * self.step[0]
        return x, self.height - _TOP - (line + 1) * self.step[1]

    def panel(self, r: int, c: int) -> tuple[float, float, float, float]:
        x, y = self.corner(r, c)
        return x / self.width, y / self.height, self.step[0] / self.width, self.step[1] / self.height

    def above(self, r: int, c: int) -> tuple[float, float]:
        x, y = self.corner(r, c)
        return (x + self.step[0] / 2) / self.width, (y + self.step[1] + _TOP / 2) / self.height

    def beside(self, r: int) -> tuple[float, float]:
        x, y = self.corner(r, 0)
        return (x - _LEFT / 2) / self.width, (y + self.step[1] / 2) / self.height


def _common_view(meshes: Sequence[Mesh], view: View, size: tuple[int, int]) -> View:
    """Fix the scale, so that the largest mesh fits its panel and all are as large as they are."""
    if view.height is not None:
        return view
    unit = 1000.0
    tallest = 0.0
    for mesh in {id(mesh): mesh for mesh in meshes}.values():
        seen = project(mesh, View(view.up, view.azimuth, view.elevation, height=unit), 1000, 1000)
        extent = np.ptp(seen[np.unique(mesh.faces), :2], axis=0)
        tallest = max(tallest, float(extent[1]), float(extent[0]) * size[1] / size[0])
    return View(view.up, view.azimuth, view.elevation, height=1.06 * tallest * unit / 1000)


def _draw(axes: Axes, panel: Panel, scale: Scale, view: View, size: tuple[int, int]) -> None:
    colors = scalar_colors(panel.values, 0.0, scale.high, scale.colormap)
    axes.imshow(render(panel.mesh, colors, size=size, view=view, supersample=3), extent=(0, size[0], size[1], 0))
    axes.set_axis_off()
    if panel.mark is None:
        return
    where, seen = locate(panel.mesh, [panel.mark], view, size)
    fill, edge = ("white", "black") if seen[0] else ("none", "0.35")
    axes.plot(*where[0], marker="o", markersize=3.4, markeredgewidth=0.8, clip_on=False, mfc=fill, mec=edge)


def _text(figure: Figure, where: tuple[float, float], text: str, *, rotation: int, weight: str = "normal") -> None:
    figure.text(*where, text, rotation=rotation, weight=weight, fontsize=7.5, ha="center", va="center")


def _color_bar(figure: Figure, layout: _Layout, scale: Scale) -> None:
    length = min(4.0, 0.8 * layout.width)
    place = (
        (layout.width - length) / 2 / layout.width,
        0.40 / layout.height,
        length / layout.width,
        0.11 / layout.height,
    )
    bar = figure.colorbar(
        ScalarMappable(Normalize(0, scale.high), scale.colormap),
        cax=figure.add_axes(place),
        orientation="horizontal",
        extend="max",
    )
    bar.set_label(scale.label, fontsize=7.5, labelpad=2)
    bar.ax.tick_params(labelsize=7, length=2, pad=2)
