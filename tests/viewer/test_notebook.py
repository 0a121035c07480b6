from __future__ import annotations

import re
from html import unescape

import numpy as np

import csm
from csm.matching.nearest import Nearest
from csm.mesh.shape import Mesh
from csm.viewer import notebook
from csm.viewer.notebook import match_frame, mesh_frame
from tests.shapes import blob


def page_in(frame: str) -> str:
    found = re.fullmatch(r'<iframe srcdoc="(.*)" style="[^"]*"></iframe>', frame, re.DOTALL)
    assert found
    assert "<" not in found[1]
    return unescape(found[1])


def test_a_mesh_shows_itself_as_a_whole_page_in_a_frame():
    page = page_in(blob(2)._repr_html_())
    assert "162 vertices, 320 faces" in page
    assert page.count("<html") == 1


def test_a_match_shows_both_meshes_without_its_descriptors():
    match = csm.match(blob(2), blob(2), csm.preset("hks", k=10, n_times=4), Nearest(), "none")
    page = page_in(match._repr_html_())
    assert "confidence" in page
    assert len(page) < len(unescape(csm.viewer.match_folder.match_page(match, "x")))


def test_what_is_large_or_cannot_be_drawn_is_left_to_its_text(monkeypatch):
    assert mesh_frame(Mesh(np.eye(3), np.zeros((0, 3), int))) is None
    match = csm.match(blob(1), blob(1), csm.preset("hks", k=10, n_times=4), Nearest(), "none")
    monkeypatch.setattr(notebook, "MOST_VERTICES", 41)
    assert mesh_frame(blob(1)) is None or blob(1).n_vertices <= 41
    assert match_frame(match) is None
