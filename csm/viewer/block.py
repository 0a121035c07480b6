"""The html of a viewer: buttons, scales, a place for each mesh and for what is said of a vertex."""

from __future__ import annotations

from html import escape

from csm.viewer.colors import ramp
from csm.viewer.scene import Panel, Viewer, scene_json

MODES = {
    "matched": "Colours",
    "checker": "Checker",
    "stripes": "Stripes",
    "confidence": "Confidence",
    "errors": "Error",
    "distance": "Descriptor",
    "plain": "Shape",
}
"""What the colours of a page can show, in the order of the buttons, and what the buttons say."""

_ALWAYS = ("matched", "checker", "stripes", "plain")
_STOPS = 12
_HELP = (
    "Meshes stand as their partners do, where the map lets them. Drag, or one finger: turn. Shift-drag, or "
    "two fingers: move. Wheel on a mesh that was clicked, or two fingers apart: zoom. Point at a mesh to see the "
    "partner of a vertex; click or tap to pin it. Keys: arrows turn, + and - zoom, 0 is the first view, the other "
    "numbers choose what the colours show, Enter pins the middle of the mesh, Escape unpins. A broken ring lies behind "
    "the surface; a small dot is one of several vertices with one partner."
)
_NO_SCRIPT = "The meshes need JavaScript and WebGL; the text of this page needs neither."


def modes(viewer: Viewer) -> list[str]:
    """Return what the colours can show of a viewer, in the order of `MODES`."""
    return [name for name in MODES if name in _ALWAYS or name in viewer.scales]


def viewer_block(viewer: Viewer) -> str:
    """Write the html of a viewer; the page's script brings it to life."""
    panels = "\n".join(_panel(panel) for panel in viewer.panels)
    faces = max(panel.mesh.n_faces for panel in viewer.panels)
    caption = f'<p class="caption">{escape(viewer.caption)}</p>\n' if viewer.caption else ""
    return (
        f'<div class="viewer" data-faces="{faces}">\n<div class="bar">{_buttons(viewer)}</div>\n'
        f'<div class="scales">{_scales(viewer)}</div>\n'
        f'<div class="panels">\n{panels}\n</div>\n'
        '<div class="readout"><p class="pinned" aria-live="polite"></p><p class="hovered"></p></div>\n'
        f"{caption}<details><summary>How to turn, point and pin</summary><p>{escape(_HELP)}</p></details>\n"
        f"<noscript><p>{_NO_SCRIPT}</p></noscript>\n"
        f'<script type="application/json">{scene_json(viewer)}</script>\n</div>'
    )


def _panel(panel: Panel) -> str:
    title = escape(panel.title)
    return (
        f'<div class="panel"><p>{title} <small>{panel.mesh.n_vertices:,} vertices</small></p><div class="view">'
        f'<canvas tabindex="0" role="img" aria-label="{title}, a mesh that can be turned"></canvas></div></div>'
    )


def _buttons(viewer: Viewer) -> str:
    buttons = "".join(
        f'<button type="button" data-mode="{mode}" title="key {key}">{MODES[mode]}</button>'
        for key, mode in enumerate(modes(viewer), 1)
    )
    return (
        f'<span class="modes" role="group" aria-label="What the colours show">{buttons}</span>'
        '<button type="button" class="reset" title="key 0">Front view</button>'
    )


def _scales(viewer: Viewer) -> str:
    reference = escape(viewer.panels[viewer.reference].title)
    said = {
        "matched": f"Mapped vertices have the same colour. Orange to blue: left to right of {reference} in the front "
        "view; dark to light: its bottom to top.",
        "checker": "A checkerboard on the mesh that is mapped to, pulled through the map: torn where the map is torn.",
        "stripes": "Slanted stripes pulled through the map; they slant the other way where left and right are swapped.",
        "plain": "The shape alone.",
    }
    unmatched = any(panel.to_reference is not None and min(panel.to_reference) < 0 for panel in viewer.panels)
    hatched = " Hatched: no counterpart." if unmatched else ""
    numbers = {
        "confidence": ("1", viewer.confidence_label),
        "errors": (f"{viewer.top_error or 0:.3g} and more", viewer.error_label),
        "distance": ('<span class="high">?</span> and more', "distance of descriptors to the pinned vertex"),
    }
    parts = []
    for mode in modes(viewer):
        text = _scale(mode, *numbers[mode]) if mode in numbers else said[mode] + (mode != "plain") * hatched
        parts.append(f'<span class="scale" data-scale="{mode}" hidden>{text}</span>')
    return "".join(parts)


def _scale(name: str, high: str, label: str) -> str:
    stops = ", ".join(f"rgb({r}, {g}, {b})" for r, g, b in ramp(name, _STOPS).tolist())
    return (
        f'0 <span class="ramp" style="background: linear-gradient(to right, {stops})"></span> {high}: {escape(label)}; '
        "hatched is unknown"
    )
