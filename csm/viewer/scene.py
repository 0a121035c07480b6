"""Meshes that turn together in a page: what the reader of the page needs, packed as text."""

from __future__ import annotations

import base64
import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from csm._types import FloatArray, IntArray
from csm.errors import ConfigError, MeshError
from csm.mesh.shape import Mesh
from csm.viewer.camera import View, body_axes, turned_alike
from csm.viewer.colors import Colors, ramp
from csm.viewer.features import compact_features

_SHADES = 128


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
    confidence
        Shape (N,): from 0 to 1, how far to believe where each vertex is mapped to; not a number where it is unknown.
    features
        Shape (N, Q): descriptors of the vertices; not a number where there are none.  The page holds them in the few
        bytes of `csm.viewer.features.compact_features` and compares vertices by them.

    Raises
    ------
    ConfigError
        If an array has the wrong length, or a confidence is not between 0 and 1.
    MeshError
        If the mesh cannot be drawn.
    """

    mesh: Mesh
    colors: Colors
    label: str = ""
    to_reference: IntArray | None = None
    errors: FloatArray | None = None
    confidence: FloatArray | None = None
    features: NDArray[np.floating[Any]] | None = None

    def __post_init__(self) -> None:
        n = self.mesh.n_vertices
        columns = 0 if self.features is None else self.features.shape[-1]
        if self.mesh.n_faces == 0 or not np.isfinite(self.mesh.vertices).all():
            raise MeshError(f"{self.mesh.label}: a page can show only meshes with faces and finite coordinates")
        for what, array, wanted in (
            ("colours", self.colors, (n, 3)),
            ("the map", self.to_reference, (n,)),
            ("errors", self.errors, (n,)),
            ("confidences", self.confidence, (n,)),
            ("features", self.features, (n, columns)),
        ):
            if array is not None and np.shape(array) != wanted:
                raise ConfigError(f"{self.mesh.label}: {what} have shape {np.shape(array)}, wanted {wanted}")
        if self.confidence is not None and ((self.confidence < 0) | (self.confidence > 1)).any():
            raise ConfigError(f"{self.mesh.label}: a confidence is not between 0 and 1")

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
        One or more, shown from left to right.  All or none of them have features.
    reference
        Position of the panel that the maps of the others go to.  A source and a target that it is mapped to are
        ``Viewer([source, target], reference=1)``.
    view
        Where the viewer stands at first; its axes fit every panel (see `Panel.mesh` and `View.up`), and panels with a
        map are turned so that they stand as the reference does.
    error_label
        What the errors are, with their unit, such as "geodesic error, fraction of the diameter".
    error_high
        Error that gets the last colour; by default the 98th percentile of all errors.
    confidence_label
        What the confidences are.
    caption
        Text below the meshes.

    Raises
    ------
    ConfigError
        If there is no such reference panel, a map leaves the reference mesh, or features cannot be compared.
    """

    panels: Sequence[Panel]
    reference: int = 0
    view: View = field(default_factory=lambda: View(up="auto"))
    error_label: str = "error"
    error_high: float | None = None
    confidence_label: str = "confidence in the match"
    caption: str = ""

    def __post_init__(self) -> None:
        if not 0 <= self.reference < len(self.panels):
            raise ConfigError(f"viewer of {len(self.panels)} meshes: there is no reference panel {self.reference}")
        n = self.panels[self.reference].mesh.n_vertices
        for panel in self.panels:
            indices = panel.to_reference
            if indices is not None and (np.min(indices, initial=0) < -1 or np.max(indices, initial=0) >= n):
                raise ConfigError(f"{panel.title}: its map leaves the reference mesh, which has vertices 0..{n - 1}")
        columns = [None if p.features is None else np.shape(p.features)[1] for p in self.panels]
        if len(set(columns)) > 1:
            raise ConfigError(f"viewer: its meshes have features of {columns} columns, wanted the same for all of them")

    @property
    def top_error(self) -> float | None:
        """Error that gets the last colour, or None if no panel has a known error."""
        known = _finite([p.errors for p in self.panels])
        if known.size == 0:
            return None
        return self.error_high if self.error_high is not None else float(np.percentile(known, 98))

    @property
    def scales(self) -> dict[str, float | None]:
        """Which numbers there are, in the order of `RAMPS`, and the one of the last colour; None if it varies."""
        known = {
            "confidence": 1.0 if _finite([p.confidence for p in self.panels]).size else None,
            "errors": self.top_error,
        }
        found: dict[str, float | None] = {name: high for name, high in known.items() if high is not None}
        return found if self.panels[0].features is None else {**found, "distance": None}


def _finite(arrays: Sequence[FloatArray | None]) -> FloatArray:
    given = [np.asarray(a, dtype=np.float64) for a in arrays if a is not None]
    return np.concatenate([a[np.isfinite(a)] for a in given]) if given else np.zeros(0)


def pack(array: ArrayLike, kind: str) -> str:
    """Write an array as base64 of its little-endian bytes of a numpy kind such as "f4"."""
    return base64.b64encode(np.ascontiguousarray(array, dtype=f"<{kind}").tobytes()).decode("ascii")


def scene_json(viewer: Viewer) -> str:
    """Write a viewer as json that can stand inside a script element whatever the names are."""
    scene: dict[str, Any] = {
        "reference": viewer.reference,
        "view": {"azimuth": viewer.view.azimuth, "elevation": viewer.view.elevation},
        "scales": {
            name: {"high": high, "ramp": pack(ramp(name, _SHADES), "u1")} for name, high in viewer.scales.items()
        },
        "panels": [_panel_data(panel, viewer) for panel in viewer.panels],
    }
    features = [panel.features for panel in viewer.panels if panel.features is not None]
    if features:
        compact = compact_features(features)
        scene["steps"] = compact.steps.tolist()
        for data, codes in zip(scene["panels"], compact.codes, strict=True):
            data["features"] = pack(codes, "i1")
    text = json.dumps(scene, allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _axes(panel: Panel, viewer: Viewer) -> FloatArray:
    """Return the directions right, up and front of a panel: those of the reference panel where it is mapped to it."""
    reference, up = viewer.panels[viewer.reference].mesh, viewer.view.up
    if panel.to_reference is None or panel.mesh is reference:
        return body_axes(panel.mesh, up)
    return turned_alike(panel.mesh, panel.to_reference, reference, up)


def _panel_data(panel: Panel, viewer: Viewer) -> dict[str, Any]:
    mesh = panel.mesh
    wide = mesh.n_vertices > 65536
    data: dict[str, Any] = {
        "label": panel.title,
        "axes": _axes(panel, viewer).tolist(),
        "wide": wide,
        "vertices": pack(mesh.vertices, "f4"),
        "faces": pack(mesh.faces, "u4" if wide else "u2"),
        "colors": pack(panel.colors, "u1"),
    }
    if panel.to_reference is not None:
        data["map"] = pack(panel.to_reference, "i4")
    for name, values in (("confidence", panel.confidence), ("errors", panel.errors)):
        if values is not None and name in viewer.scales:
            data[name] = pack(values, "f4")
    return data
