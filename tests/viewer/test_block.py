"""The html around the meshes: a button and a scale for all that can be shown and for nothing else, and safe names."""

from __future__ import annotations

import json
import re
from html.parser import HTMLParser
from importlib.resources import files

import numpy as np

from csm.viewer.block import MODES, modes, viewer_block
from csm.viewer.colors import position_colors
from csm.viewer.scene import Panel, Viewer, scene_json
from tests.shapes import sphere
from tests.viewer.test_scene import a_pair

NASTY = "</script><script>alert('1 & \"2\"')</script><!--"


def test_there_is_a_button_and_a_scale_for_everything_that_there_is() -> None:
    block = viewer_block(a_pair())
    assert re.findall(r'data-mode="(\w+)"', block) == re.findall(r'data-scale="(\w+)"', block) == list(MODES)
    assert "Hatched: no counterpart" in block


def test_what_has_no_data_has_no_button() -> None:
    mesh = sphere(1)
    nothing = np.full(mesh.n_vertices, np.nan)
    viewer = Viewer([Panel(mesh, position_colors(mesh), errors=nothing, confidence=nothing)])
    assert modes(viewer) == ["matched", "checker", "stripes", "plain"]
    block = viewer_block(viewer)
    assert 'data-mode="errors"' not in block
    assert 'class="ramp"' not in block
    assert "Hatched" not in block


def test_names_cannot_break_out_of_their_place() -> None:
    viewer = Viewer(a_pair(NASTY).panels, reference=1, caption=NASTY, error_label=NASTY, confidence_label=NASTY)
    block = viewer_block(viewer)
    assert "<script>" not in block
    assert "<!--" not in block
    assert block.count("</script") == 1
    found = _Collector.read(block)
    assert [tag for tag in found.tags if tag == "script"] == ["script"]
    assert json.loads(found.script)["panels"][0]["label"] == NASTY
    assert found.text.count(NASTY) == 4  # heading, caption and two scales
    assert f"{NASTY}, a mesh that can be turned" in found.labels


def test_script_finds_every_part_that_it_looks_for() -> None:
    parts = [p.read_text(encoding="utf-8") for p in (files("csm.viewer") / "web").iterdir() if p.name.endswith(".js")]
    script = "\n".join(parts)
    wanted = set(re.findall(r'root\.querySelector(?:All)?\("([^"]+)"\)', script))
    assert wanted >= {"script", "canvas", ".pinned", ".hovered", ".reset", "[data-mode]", "[data-scale]"}
    block = viewer_block(a_pair())
    for selector in wanted:
        sign = {".": f'class="{selector[1:]}"', "[": selector[1:-1] + "="}.get(selector[0], f"<{selector}")
        assert sign in block
    assert block.count("<canvas") == 2
    scene = json.loads(scene_json(a_pair()))
    assert set(re.findall(r"\bdata\.(\w+)", script)) == set().union(*scene["panels"])
    assert set(re.findall(r"\bscene\.(\w+)", script)) == scene.keys()


def test_parts_of_the_script_are_short() -> None:
    web = files("csm.viewer") / "web"
    long = [p.name for p in web.iterdir() if p.name.endswith(".js") and len(p.read_text("utf-8").splitlines()) > 300]
    assert long == []


class _Collector(HTMLParser):
    """Text, tags, labels and the script of a piece of html."""

    def __init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.tags: list[str] = []
        self.labels: list[str] = []
        self.text = self.script = ""

    @classmethod
    def read(cls, html: str) -> _Collector:
        parser = cls()
        parser.feed(html)
        parser.close()
        return parser

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.labels += [value or "" for name, value in attrs if name == "aria-label"]

    def handle_data(self, data: str) -> None:
        if self.tags[-1] == "script" and not self.script:
            self.script = data
        else:
            self.text += data
