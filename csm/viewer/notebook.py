"""Meshes and matches that show themselves in a notebook: the viewer, in a frame."""

from __future__ import annotations

from dataclasses import replace
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from csm.mesh.shape import Mesh
from csm.viewer.colors import position_colors
from csm.viewer.html import viewer_html
from csm.viewer.match_folder import in_words, match_page
from csm.viewer.scene import Panel, Viewer

if TYPE_CHECKING:
    from csm.matching.result import Match

MOST_VERTICES = 60_000
"""Of all meshes in a frame together; larger ones would make a notebook of many megabytes, and are shown as text."""

_HEIGHT = 520


def mesh_frame(mesh: Mesh) -> str | None:
    """Return a frame with a mesh, coloured by position; None of a mesh that is too large or cannot be drawn."""
    if not mesh.n_faces or mesh.n_vertices > MOST_VERTICES or not np.isfinite(mesh.vertices).all():
        return None
    viewer = Viewer([Panel(mesh, position_colors(mesh))])
    return _frame(viewer_html(mesh.name or "mesh", viewer, lead=f"{mesh.n_vertices} vertices, {mesh.n_faces} faces."))


def match_frame(match: Match) -> str | None:
    """Return a frame with both meshes of a match, without their descriptors; None of meshes that are too large."""
    if match.source.n_vertices + match.target.n_vertices > MOST_VERTICES:
        return None
    return _frame(match_page(replace(match, features=None), in_words(match)))


def _frame(page: str) -> str:
    return f'<iframe srcdoc="{escape(page)}" style="width:100%;height:{_HEIGHT}px;border:0"></iframe>'
