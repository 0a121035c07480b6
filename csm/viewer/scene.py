"""Meshes that turn together in a page: what the reader of the page needs, packed as text."""

from __future__ import annotations

import base64
import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from csm._types import FloatArray, IntArray
from csm.errors import ConfigError, MeshError
from csm.mesh.shape import Mesh
from csm.viewer.camera import View, body_axes
from csm.viewer.colors import ERROR_COLORMAP, Colors, scalar_colors

_RAMP_STOPS = 12
_HINT = (
    "Drag to turn, shift-drag to move, click a mesh and scroll to zoom, double-click to start again; or use the arrow "
    "keys, + and -. Point at a mesh to see where a vertex is mapped: a broken ring lies behind the surface."
)


@dataclass(frozen=True, eq=False)
class Panel:
    """One mesh of a viewer.

    Parameters
    ----------
    mesh
        N vertices, M faces.
    colors
        Shape (N, 3), uint8.
    label
        Heading of the panel; the mesh's name by default.
    to_reference
        Shape (N,): the vertex of the viewer's reference panel that each vertex is mapped to, or -1.
    errors
        Shape (N,): error of each vertex of this mesh; not a number where it is unknown.

    Raises
    ------
    ConfigError
        If an array has the wrong length.
    MeshError
        If the mesh cannot be drawn.
    """

    mesh: Mesh
    colors: Colors
    label: str = ""
    to_reference: IntArray | None = None
    errors: FloatArray | None = None

    def __post_init__(self) -> None:
        n = self.mesh.n_vertices
        if self.mesh.n_faces == 0 or not np.isfinite(self.mesh.vertices).all():
            raise MeshError(f"{self.mesh.label}: a page can show only meshes with faces and finite coordinates")
        for what, array, wanted in (
            ("colours", self.colors, (n, 3)),
            ("the map", self.to_reference, (n,)),
            ("errors", self.errors, (n,)),
        ):
            if array is not None and np.shape(array) != wanted:
                raise ConfigError(f"{self.mesh.label}: {what} have shape {np.shape(array)}, wanted {wanted}")

    @property
    def title(self) -> str:
        """The label or, without one, the name of the mesh."""
        return self.label or self.mesh.name


@dataclass(frozen=True, eq=False)
class Viewer:
    """Meshes side by side in a page, turned, zoomed and moved together.

    Parameters
    ----------
    panels
        One or more, shown from left to right.
    reference
        Position of the panel that the maps of the others go to.  A source and a target that it is mapped to are
        ``Viewer([source, target], reference=1)``.
    view
        Where the viewer stands at first; its axes fit every panel (see `Panel.mesh` and `View.up`).
    error_label
        What the errors are, with their unit, such as "geodesic error, fraction of the diameter".
    error_high
        Error that gets the last colour; by default the 98th percentile of all errors.
    caption
        Text below the meshes.

    Raises
    ------
    ConfigError
        If there is no such reference panel or a map leaves the reference mesh.
    """

    panels: Sequence[Panel]
    reference: int = 0
    view: View = field(default_factory=lambda: View(up="auto"))
    error_label: str = "error"
    error_high: float | None = None
    caption: str = ""

    def __post_init__(self) -> None:
        if not 0 <= self.reference < len(self.panels):
            raise ConfigError(f"viewer of {len(self.panels)} meshes: there is no reference panel {self.reference}")
        n = self.panels[self.reference].mesh.n_vertices
        for panel in self.panels:
            indices = panel.to_reference
            if indices is not None and (np.min(indices, initial=0) < -1 or np.max(indices, initial=0) >= n):
                raise ConfigError(f"{panel.title}: its map leaves the reference mesh, which has vertices 0..{n - 1}")

    @property
    def top_error(self) -> float | None:
        """Error that gets the last colour, or None if no panel has a known error."""
        given = [np.asarray(p.errors)[np.isfinite(p.errors)] for p in self.panels if p.errors is not None]
        known = np.concatenate(given) if given else np.zeros(0)
        if known.size == 0:
            return None
        return self.error_high if self.error_high is not None else float(np.percentile(known, 98))


def pack(array: ArrayLike, kind: str) -> str:
    """Write an array as base64 of its little-endian bytes of a numpy kind such as "f4"."""
    return base64.b64encode(np.ascontiguousarray(array, dtype=f"<{kind}").tobytes()).decode("ascii")


def scene_json(viewer: Viewer) -> str:
    """Write a viewer as json that can stand inside a script element whatever the names are."""
    scene = {
        "reference": viewer.reference,
        "view": {"azimuth": viewer.view.azimuth, "elevation": viewer.view.elevation},
        "panels": [_panel_data(panel, viewer) for panel in viewer.panels],
    }
    text = json.dumps(scene, allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def viewer_block(viewer: Viewer) -> str:
    """Write the html of a viewer; the page's script brings it to life."""
    panels = "\n".join(_panel_html(panel) for panel in viewer.panels)
    caption = f"<p>{escape(viewer.caption)}</p>\n" if viewer.caption else ""
    return (
        f'<div class="viewer">\n<div class="bar">{_controls(viewer)}</div>\n<div class="panels">\n{panels}\n</div>\n'
        f'<p class="readout" aria-live="polite"></p>\n{caption}<p class="hint">{escape(_HINT)}</p>\n'
        f'<script type="application/json">{scene_json(viewer)}</script>\n</div>'
    )


def _panel_data(panel: Panel, viewer: Viewer) -> dict[str, Any]:
    mesh, top = panel.mesh, viewer.top_error
    wide = mesh.n_vertices > 65536
    data: dict[str, Any] = {
        "label": panel.title,
        "axes": body_axes(mesh, viewer.view.up).tolist(),
        "wide": wide,
        "vertices": pack(mesh.vertices, "f4"),
        "faces": pack(mesh.faces, "u4" if wide else "u2"),
        "colors": pack(panel.colors, "u1"),
    }
    if panel.to_reference is not None:
        data["map"] = pack(panel.to_reference, "i4")
    if panel.errors is not None and top is not None:
        data["errors"] = pack(panel.errors, "f4")
        data["errorColors"] = pack(scalar_colors(panel.errors, colormap=ERROR_COLORMAP, low=0.0, high=top), "u1")
    return data


def _panel_html(panel: Panel) -> str:
    title = escape(panel.title)
    return (
        f'<div class="panel"><p>{title} <small>{panel.mesh.n_vertices:,} vertices</small></p>'
        f'<canvas tabindex="0" role="img" aria-label="{title}, a mesh that can be turned"></canvas></div>'
    )


def _controls(viewer: Viewer) -> str:
    top = viewer.top_error
    modes = [("matched", "Colours"), *([("errors", "Errors")] if top is not None else []), ("plain", "Shape")]
    buttons = "".join(f'<button type="button" data-mode="{mode}">{text}</button>' for mode, text in modes)
    scale = "" if top is None else _error_scale(viewer.error_label, top)
    return (
        f'<span class="modes" role="group" aria-label="What the colours show">{buttons}</span>'
        f'<button type="button" class="reset">Front view</button>{scale}'
    )


def _error_scale(label: str, top: float) -> str:
    ramp = scalar_colors(np.linspace(0, 1, _RAMP_STOPS), colormap=ERROR_COLORMAP)
    stops = ", ".join(f"rgb({r}, {g}, {b})" for r, g, b in ramp.tolist())
    return (
        '<span class="scale" hidden>0 '
        f'<span class="ramp" style="background: linear-gradient(to right, {stops})"></span> '
        f"{top:.3g} and more: {escape(label)}; grey is unknown</span>"
    )
