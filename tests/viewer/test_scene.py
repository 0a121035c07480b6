"""What a page holds of its meshes is what was put in, whatever they are called."""

from __future__ import annotations

import base64
import json

import numpy as np
import pytest

from csm.errors import ConfigError, MeshError
from csm.mesh.shape import Mesh
from csm.viewer.camera import View
from csm.viewer.colors import position_colors, pull_colors
from csm.viewer.scene import Panel, Viewer, pack, scene_json
from tests.shapes import blob, sphere


def a_pair(label: str = "source") -> Viewer:
    source, target = sphere(1), blob(2)
    indices = np.random.default_rng(0).integers(0, target.n_vertices, source.n_vertices)
    indices[3] = -1
    errors = np.linspace(0, 0.5, source.n_vertices)
    errors[3] = np.nan
    reference = position_colors(target)
    first = Panel(
        source, pull_colors(reference, indices), label, indices, errors, errors * 2, np.tile(source.vertices, 2)
    )
    return Viewer([first, Panel(target, reference, features=np.tile(target.vertices, 2))], reference=1)


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


def test_scales_run_from_one_lightness_to_the_other_and_end_at_the_top_error() -> None:
    viewer = a_pair()
    scales = json.loads(scene_json(viewer))["scales"]
    assert list(scales) == ["confidence", "errors", "distance"]
    for scale in scales.values():
        lightness = unpack(scale["ramp"], "u1").reshape(-1, 3) @ [0.2126, 0.7152, 0.0722]
        assert (np.diff(lightness) <= 1).all() or (np.diff(lightness) >= -1).all()
        assert abs(lightness[0] - lightness[-1]) > 100
    assert scales["errors"]["high"] == viewer.top_error == pytest.approx(np.nanpercentile(viewer.panels[0].errors, 98))
    assert scales["confidence"]["high"] == 1
    assert scales["distance"]["high"] is None
    assert Viewer(viewer.panels, reference=1, error_high=0.2).top_error == 0.2


def test_scene_holds_confidences_and_compact_features() -> None:
    viewer = a_pair()
    scene = json.loads(scene_json(viewer))
    np.testing.assert_allclose(unpack(scene["panels"][0]["confidence"], "f4"), viewer.panels[0].confidence, rtol=1e-6)
    assert "confidence" not in scene["panels"][1]
    steps = np.array(scene["steps"])
    codes = [unpack(data["features"], "i1").reshape(-1, len(steps)).astype(float) for data in scene["panels"]]
    features = [panel.features for panel in viewer.panels]
    np.testing.assert_allclose(
        np.linalg.norm((codes[0][:20, None] - codes[1]) * steps, axis=2),
        np.linalg.norm(features[0][:20, None] - features[1], axis=2),
        atol=0.1,
    )


def test_without_numbers_there_are_no_scales() -> None:
    source = sphere(1)
    for unknown in (None, np.full(source.n_vertices, np.nan)):
        viewer = Viewer([Panel(source, position_colors(source), errors=unknown, confidence=unknown)])
        assert viewer.top_error is None
        assert viewer.scales == {}
        data = json.loads(scene_json(viewer))["panels"][0]
        assert not {"errors", "confidence", "features"} & data.keys()


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
    with pytest.raises(ConfigError, match="confidences have shape"):
        Panel(mesh, colors, confidence=np.zeros(3))
    with pytest.raises(ConfigError, match="not between 0 and 1"):
        Panel(mesh, colors, confidence=np.full(mesh.n_vertices, 1.5))
    with pytest.raises(ConfigError, match="features have shape"):
        Panel(mesh, colors, features=np.zeros((3, 2)))
    with pytest.raises(ConfigError, match="the same for all"):
        Viewer([Panel(mesh, colors), Panel(mesh, colors, features=np.zeros((mesh.n_vertices, 2)))])
    with pytest.raises(MeshError, match="faces"):
        Panel(Mesh(mesh.vertices, np.zeros((0, 3))), colors)
    with pytest.raises(ConfigError, match="reference panel 1"):
        Viewer([Panel(mesh, colors)], reference=1)
    with pytest.raises(ConfigError, match="leaves the reference mesh"):
        Viewer([Panel(mesh, colors), Panel(mesh, colors, to_reference=np.full(mesh.n_vertices, 42))])
