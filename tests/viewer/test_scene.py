"""What a page holds of its meshes is what was put in, whatever they are called."""

from __future__ import annotations

import base64
import json
import re
from html.parser import HTMLParser
from importlib.resources import files

import numpy as np
import pytest

from csm.errors import ConfigError, MeshError
from csm.mesh.shape import Mesh
from csm.viewer.camera import View
from csm.viewer.colors import position_colors, pull_colors
from csm.viewer.scene import Panel, Viewer, pack, scene_json, viewer_block
from tests.shapes import blob, sphere

NASTY = "</script><script>alert('1 & \"2\"')</script><!--"


def a_pair(label: str = "source") -> Viewer:
    source, target = sphere(1), blob(2)
    indices = np.random.default_rng(0).integers(0, target.n_vertices, source.n_vertices)
    indices[3] = -1
    errors = np.linspace(0, 0.5, source.n_vertices)
    errors[3] = np.nan
    reference = position_colors(target)
    return Viewer(
        [Panel(source, pull_colors(reference, indices), label, indices, errors), Panel(target, reference)], reference=1
    )


def unpack(text: str, kind: str) -> np.ndarray:
    """Read what `pack` wrote, as the script of the page does: a flat array of little-endian numbers."""
    return np.frombuffer(base64.b64decode(text), dtype=f"<{kind}")


@pytest.mark.parametrize("kind", ["f4", "u1", "u2", "u4", "i4"])
def test_arrays_come_back_from_text(kind: str) -> None:
    values = np.arange(-3 if kind[0] in "if" else 0, 250)
    np.testing.assert_array_equal(unpack(pack(values, kind), kind), values)


def test_scene_holds_the_geometry_the_map_and_the_errors() -> None:
    viewer = a_pair()
    scene = json.loads(scene_json(viewer))
    for data, panel in zip(scene["panels"], viewer.panels, strict=True):
        np.testing.assert_array_equal(
            unpack(data["vertices"], "f4").reshape(-1, 3), panel.mesh.vertices.astype(np.float32)
        )
        np.testing.assert_array_equal(unpack(data["faces"], "u2").reshape(-1, 3), panel.mesh.faces)
        np.testing.assert_array_equal(unpack(data["colors"], "u1").reshape(-1, 3), panel.colors)
        axes = np.array(data["axes"])
        np.testing.assert_allclose(axes @ axes.T, np.eye(3))
    np.testing.assert_array_equal(unpack(scene["panels"][0]["map"], "i4"), viewer.panels[0].to_reference)
    np.testing.assert_allclose(unpack(scene["panels"][0]["errors"], "f4"), viewer.panels[0].errors, rtol=1e-6)
    assert scene["reference"] == 1
    assert scene["panels"][1]["label"] == "blob"
    assert "map" not in scene["panels"][1]
    assert "errors" not in scene["panels"][1]


def test_largest_short_index_fits_and_the_next_vertex_makes_them_wide() -> None:
    for n, wide in ((65536, False), (65537, True)):
        mesh = Mesh(np.zeros((n, 3)), [[0, 1, n - 1]])
        data = json.loads(scene_json(Viewer([Panel(mesh, np.zeros((n, 3), np.uint8))])))["panels"][0]
        assert data["wide"] is wide
        np.testing.assert_array_equal(unpack(data["faces"], "u4" if wide else "u2"), [0, 1, n - 1])


def test_error_colours_run_from_pale_to_dark_and_unknown_is_grey() -> None:
    viewer = a_pair()
    data = json.loads(scene_json(viewer))["panels"][0]
    colors = unpack(data["errorColors"], "u1").reshape(-1, 3).astype(int)
    assert (colors[3] == colors[3, 0]).all()
    known = np.delete(colors, 3, axis=0) @ [0.2126, 0.7152, 0.0722]
    assert (np.diff(known) <= 1).all()
    assert known[0] > known[-1] + 100
    assert viewer.top_error == pytest.approx(np.nanpercentile(viewer.panels[0].errors, 98))
    assert Viewer(viewer.panels, reference=1, error_high=0.2).top_error == 0.2


def test_without_errors_there_is_no_error_scale() -> None:
    source = sphere(1)
    for errors in (None, np.full(source.n_vertices, np.nan)):
        viewer = Viewer([Panel(source, position_colors(source), errors=errors)])
        assert viewer.top_error is None
        block = viewer_block(viewer)
        assert 'data-mode="errors"' not in block
        assert 'class="scale"' not in block


def test_names_cannot_break_out_of_their_place() -> None:
    viewer = Viewer(a_pair(NASTY).panels, reference=1, caption=NASTY, error_label=NASTY)
    block = viewer_block(viewer)
    assert "<script>" not in block
    assert "<!--" not in block
    assert block.count("</script") == 1
    found = _Collector.read(block)
    assert [tag for tag in found.tags if tag == "script"] == ["script"]
    assert json.loads(found.script)["panels"][0]["label"] == NASTY
    assert found.text.count(NASTY) == 3  # heading, caption and scale
    assert f"{NASTY}, a mesh that can be turned" in found.labels


def test_script_finds_every_part_that_it_looks_for() -> None:
    script = (files("csm.viewer") / "web" / "viewer.js").read_text(encoding="utf-8")
    wanted = set(re.findall(r'root\.querySelector(?:All)?\("([^"]+)"\)', script))
    assert wanted == {"script", "canvas", ".readout", ".reset", ".scale", "[data-mode]"}
    block = viewer_block(a_pair())
    for selector in wanted:
        sign = {".": f'class="{selector[1:]}"', "[": selector[1:-1] + "="}.get(selector[0], f"<{selector}")
        assert sign in block
    assert block.count("<canvas") == 2
    read = set(re.findall(r"\bdata\.(\w+)", script))
    assert read == set().union(*json.loads(scene_json(a_pair()))["panels"])


def test_view_of_the_viewer_is_the_view_of_the_page() -> None:
    mesh = sphere(1)
    scene = json.loads(scene_json(Viewer([Panel(mesh, position_colors(mesh))], view=View("z", 30, 12))))
    assert scene["view"] == {"azimuth": 30, "elevation": 12}
    assert scene["panels"][0]["axes"] == [[1, 0, 0], [0, 0, 1], [0, -1, 0]]


def test_what_does_not_fit_together_is_refused() -> None:
    mesh = sphere(1)
    colors = position_colors(mesh)
    with pytest.raises(ConfigError, match="colours"):
        Panel(mesh, colors[:-1])
    with pytest.raises(ConfigError, match="map"):
        Panel(mesh, colors, to_reference=np.zeros(3, dtype=np.int64))
    with pytest.raises(ConfigError, match="errors"):
        Panel(mesh, colors, errors=np.zeros(3))
    with pytest.raises(MeshError, match="faces"):
        Panel(Mesh(mesh.vertices, np.zeros((0, 3))), colors)
    with pytest.raises(ConfigError, match="reference panel 1"):
        Viewer([Panel(mesh, colors)], reference=1)
    with pytest.raises(ConfigError, match="leaves the reference mesh"):
        Viewer([Panel(mesh, colors), Panel(mesh, colors, to_reference=np.full(mesh.n_vertices, 42))])


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
