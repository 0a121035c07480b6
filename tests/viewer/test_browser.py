"""The page in a real browser: what is picked, marked, said and painted is what the arrays say."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from csm.mesh.shape import Mesh
from csm.viewer.camera import View
from csm.viewer.colors import position_colors, pull_colors, ramp
from csm.viewer.html import Section, report_html, viewer_html, write_html
from csm.viewer.scene import Panel, Viewer
from tests.shapes import blob, sphere
from tests.viewer.chromium import VIEW, Shown, chromium, front, front_vertex, seen

pytestmark = pytest.mark.browser

RNG = np.random.default_rng(0)
SOURCE, TARGET = blob(3), sphere(3)
N = SOURCE.n_vertices


def _map() -> np.ndarray:
    """Map no, one or several vertices to each, and some vertices and the lowest part to nothing."""
    indices = RNG.integers(0, N // 2, N)
    indices[(RNG.random(N) < 0.2) | (SOURCE.vertices[:, 2] < -0.3)] = -1
    return indices


MAP = _map()
CONFIDENCE = RNG.random(N)
FEATURES = [RNG.normal(size=(N, 6)) for _ in range(2)]


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with chromium() as started:
        yield started


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    reference = position_colors(TARGET, up="z")
    errors = np.where(CONFIDENCE > 0.2, 1 - CONFIDENCE, np.nan)
    first = Panel(SOURCE, pull_colors(reference, MAP), "one", MAP, errors, CONFIDENCE, FEATURES[0])
    viewer = Viewer([first, Panel(TARGET, reference, "two", features=FEATURES[1])], reference=1, view=VIEW)
    file = tmp_path_factory.mktemp("page") / "page.html"
    write_html(file, viewer_html("A map", viewer, lead="Half of it is right.", text="Much more to read. " * 200))
    return file


@pytest.fixture(scope="module")
def opened(browser: Any, path: Path) -> Shown:
    return Shown(browser, path).open()


@pytest.fixture
def shown(opened: Shown, path: Path) -> Iterator[Shown]:
    opened.page.evaluate("() => { const v = document.querySelector('.viewer').viewer; v.unpin(); v.reset(); }")
    opened.page.mouse.move(2, 2)
    opened.mode("matched")
    yield opened
    assert opened.said == []
    assert opened.asked == [path.as_uri()], "a page asks for nothing but itself"


def click(shown: Shown, panel: int, x: float = 0.5, y: float = 0.5) -> int:
    """Click at a place of a panel and return which vertex is there."""
    shown.page.mouse.click(*shown.place(panel, x, y))
    return front_vertex((SOURCE, TARGET)[panel], shown.size(panel), x, y)


def test_a_click_pins_what_is_seen_there_and_says_where_it_is_mapped_to(shown: Shown) -> None:
    for x, y in ((0.5, 0.5), (0.42, 0.6), (0.55, 0.35), (0.5, 0.8)):
        vertex = click(shown, 0, x, y)
        said = shown.text(".pinned")
        assert said.startswith(f"Pinned: one: vertex {vertex} ")
        wanted = f"→ two: vertex {MAP[vertex]} " if MAP[vertex] >= 0 else "has no counterpart "
        assert wanted in said
        assert f"confidence {CONFIDENCE[vertex]:.3g}"[:14] in said
        mark = shown.marked(0, "pin")
        assert mark["vertex"] == vertex
        assert not mark["hidden"]
        np.testing.assert_allclose(mark["place"], seen(SOURCE, shown.size(0))[vertex, :2], atol=0.1)
        if MAP[vertex] >= 0:
            place = seen(TARGET, shown.size(1))[MAP[vertex]]
            partner = shown.marked(1, "pin")
            assert partner["vertex"] == MAP[vertex]
            assert partner["hidden"] == (place[2] < 0), "a sphere hides its far half"
            np.testing.assert_allclose(partner["place"], place[:2], atol=0.1)
    shown.page.keyboard.press("Escape")
    assert shown.text(".pinned") == ""
    assert shown.page.locator(".mark.pin").count() == 0


def test_hovering_the_target_shows_who_is_mapped_there(shown: Shown) -> None:
    found = set()
    for x, y in np.stack(np.meshgrid(np.linspace(0.4, 0.6, 4), np.linspace(0.3, 0.6, 4)), axis=-1).reshape(-1, 2):
        shown.page.mouse.move(*shown.place(1, x, y))
        vertex = front_vertex(TARGET, shown.size(1), x, y)
        sources = np.flatnonzero(vertex == MAP)
        said = shown.text(".hovered")
        if len(sources) == 0:
            near = np.linalg.norm(TARGET.vertices - TARGET.vertices[vertex], axis=1)
            reached = np.unique(MAP[MAP >= 0])
            hint = said.partition("reached is ")[2].rstrip(")")
            assert said.startswith(f"two: vertex {vertex} ← no vertex of one")
            assert near[int(hint)] == pytest.approx(near[reached].min())
        else:
            away = np.linalg.norm(seen(SOURCE, shown.size(0))[sources, :2] - [x, y] * np.array(shown.size(0)), axis=1)
            more = "" if len(sources) == 1 else f" and {len(sources) - 1} more"
            assert said == f"two: vertex {vertex} ← one: vertex {sources[away.argmin()]}{more}"
            assert shown.marked(0, "hover")["vertex"] == sources[away.argmin()]
            assert shown.page.locator(".view").nth(0).locator(".mark.dot").count() == len(sources) - 1
        found.add(min(len(sources), 2))
    assert found == {0, 1, 2}, "none, one and several are all among them"
    shown.page.mouse.move(2, 2)
    assert shown.text() == ""


def test_the_colours_of_the_corners_are_seen_on_a_face(shown: Shown) -> None:
    reference = position_colors(TARGET, up="z")
    shades = ramp("confidence", 128)[np.rint(127 * CONFIDENCE).astype(int)]
    cases = [("matched", 1, reference), ("matched", 0, pull_colors(reference, MAP)), ("confidence", 0, shades)]
    for mode, panel, colors in cases:
        shown.mode(mode)
        mesh, picture, compared = (SOURCE, TARGET)[panel], shown.picture(panel), 0
        points = seen(mesh, shown.size(panel))
        for x, y in RNG.uniform(0.42, 0.58, (60, 2)) * shown.size(panel):
            corners, weights = front(mesh, points, int(x) + 0.5, int(y) + 0.5)
            if mode == "matched" and panel == 0 and MAP[corners].min() < 0:
                continue
            compared += 1
            surface, paint = (weights @ colors[corners] / 255) ** 2.2, picture[int(y), int(x), :3] ** 2.2
            (light, gloss), *_ = np.linalg.lstsq(np.stack([surface, np.ones(3)], axis=1), paint, rcond=None)
            assert 0.15 < light < 1.4, "what is lit is neither black nor white"
            assert -0.02 < gloss < 0.1
            np.testing.assert_allclose(paint, light * surface + gloss, atol=0.01, err_msg=f"{mode}, panel {panel}")
        assert compared > 8


def test_a_vertex_without_a_counterpart_is_hatched(shown: Shown) -> None:
    points, picture, found = seen(SOURCE, shown.size(0)), shown.picture(0), []
    for x, y in np.round(RNG.uniform((0.4, 0.6), (0.6, 0.85), (300, 2)) * shown.size(0)).astype(int):
        across = picture[y, x : x + 7]
        ends = [MAP[front(SOURCE, points, at + 0.5, y + 0.5)[0]].max() for at in (x, x + 6)]
        if (across[:, 3] == 1).all() and max(ends) < 0:
            found.append(across[:, :3])
    paint = np.array(found)
    assert len(paint) > 15
    assert np.ptp(paint, axis=2).max() < 0.03, "it is grey"
    assert np.median(np.ptp(paint.mean(axis=2), axis=1)) > 0.1, "dark and light take turns every few pixels"


def test_each_mode_shows_something_else_and_says_what(shown: Shown) -> None:
    click(shown, 0)
    shown.page.mouse.move(2, 2)
    names = ["matched", "checker", "stripes", "confidence", "errors", "distance", "plain"]
    pictures = []
    for key, name in enumerate(names, 1):
        shown.page.keyboard.press(str(key))
        pictures.append(shown.picture(0))
        assert shown.page.locator("[aria-pressed=true]").get_attribute("data-mode") == name
        (scale,) = [s for s in shown.page.locator("[data-scale]").all() if s.is_visible()]
        assert scale.get_attribute("data-scale") == name
    for i, picture in enumerate(pictures):
        for other in pictures[:i]:
            assert (np.abs(picture - other).max(axis=2) > 0.05).mean() > 0.02


def test_descriptors_are_compared_with_the_pinned_vertex(shown: Shown) -> None:
    shown.mode("distance")
    assert "Click a vertex" in shown.text()
    vertex = click(shown, 1)
    for panel in range(2):
        exact = np.linalg.norm(FEATURES[panel] - FEATURES[1][vertex], axis=1)
        found = json.loads(shown.page.evaluate(f"JSON.stringify([...{_PANELS}[{panel}].distances])"))
        np.testing.assert_allclose(found, exact, atol=0.08)
    assert "descriptor distance 0.00" in shown.text(".pinned")
    shown.page.keyboard.press("Escape")
    assert "Click a vertex" in shown.text()


_PANELS = "document.querySelector('.viewer').viewer.panels"


def test_keys_and_the_mouse_turn_and_zoom_all_meshes_together(shown: Shown) -> None:
    before = [shown.picture(panel) for panel in range(2)]
    shown.page.mouse.click(*shown.place(0, 0.02, 0.02))  # nothing is there to pin
    for press, view in (("ArrowRight", View("z", 30, 10)), ("ArrowUp", View("z", 30, 20)), ("0", VIEW)):
        shown.page.keyboard.press(press)
        shown.page.keyboard.press("Enter")
        assert shown.marked(0, "pin")["vertex"] == front_vertex(SOURCE, shown.size(0), 0.5, 0.5, view)
    shown.page.keyboard.press("Escape")
    shown.page.keyboard.press("+")
    larger = [shown.picture(panel) for panel in range(2)]
    assert all(covered(b) > 1.3 * covered(a) for a, b in zip(before, larger, strict=True))
    shown.page.keyboard.press("-")
    shown.page.mouse.move(*shown.place(1))
    shown.page.mouse.down()
    shown.page.mouse.move(*shown.place(1, 0.6, 0.5), steps=3)
    shown.page.mouse.up()
    shown.page.mouse.move(2, 2)
    assert all((a != shown.picture(panel)).any(axis=2).mean() > 0.05 for panel, a in enumerate(before))
    assert shown.text() == "", "a drag pins nothing"


def covered(picture: np.ndarray) -> float:
    """Return the fraction of a picture that the mesh covers."""
    return float((picture[..., 3] > 0.5).mean())


def test_fingers_tap_turn_and_pinch(browser: Any, path: Path) -> None:
    shown = Shown(browser, path, (390, 844), has_touch=True, is_mobile=True).open()
    before = shown.picture(0)
    shown.page.touchscreen.tap(*shown.place(0))
    assert shown.marked(0, "pin")["vertex"] == front_vertex(SOURCE, shown.size(0), 0.5, 0.5)
    shown.page.touchscreen.tap(*shown.place(0, 0.03, 0.03))
    assert shown.text() == ""
    wire = shown.context.new_cdp_session(shown.page)

    def touch(kind: str, *fingers: tuple[float, float]) -> None:
        points = [{"x": x, "y": y, "id": i} for i, (x, y) in enumerate(shown.place(0, *f) for f in fingers)]
        wire.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    touch("touchStart", (0.4, 0.5))
    touch("touchMove", (0.7, 0.5))
    touch("touchEnd")
    assert shown.camera("azimuth") == pytest.approx(20 - 0.5 * 0.3 * shown.box()[2], abs=1)
    assert (before != shown.picture(0)).any(axis=2).mean() > 0.05
    touch("touchStart", (0.4, 0.2), (0.6, 0.2))
    touch("touchMove", (0.3, 0.2), (0.7, 0.2))
    touch("touchEnd")
    zoom = shown.camera("zoom")
    assert zoom == pytest.approx(2, abs=0.2)
    assert shown.camera("y") == pytest.approx((zoom - 1) * 0.3, abs=0.01), "what is between the fingers stays there"
    assert shown.page.locator(".mark").count() == 0
    assert shown.said == []
    shown.context.close()


@pytest.mark.parametrize("size", [(1280, 720), (390, 844)])
def test_controls_meshes_and_readout_are_in_the_window(browser: Any, path: Path, size: tuple[int, int]) -> None:
    shown = Shown(browser, path, size, has_touch=size[0] < 500, is_mobile=size[0] < 500).open()
    for selector in ("h1", ".bar", ".scales", ".panels", ".readout"):
        box = shown.page.locator(selector).bounding_box()
        assert box["y"] >= 0
        assert box["y"] + box["height"] <= size[1]
        assert box["x"] + box["width"] <= size[0]
    assert shown.box()[3] > 0.4 * size[1], "and the meshes have most of it"
    assert shown.page.evaluate("document.documentElement.scrollWidth") <= size[0]
    shown.context.close()


def test_a_mesh_of_many_vertices_and_a_folded_one_are_picked_right(browser: Any, tmp_path: Path) -> None:
    ball = sphere(6)
    many = Mesh(np.concatenate([np.zeros((30000, 3)), ball.vertices]), ball.faces + 30000, name="many")
    assert many.n_vertices > 65536
    corners = [[-1, 0, -1], [1, 0, -1], [0, -0.4, 1], [0, 0.4, 1]]  # two faces of one edge, one before the other
    folds = ([0, 1, 2, 3], [0, 1, 3, 2])
    sheets = [Mesh(np.array(corners, dtype=float)[order], [[2, 0, 1], [3, 1, 0]], name="sheet") for order in folds]
    panels = [Panel(mesh, position_colors(mesh)) for mesh in (many, *sheets)]
    write_html(tmp_path / "many.html", viewer_html("many", Viewer(panels, view=VIEW)))
    shown = Shown(browser, tmp_path / "many.html").open()
    for panel, (mesh, y) in enumerate([(many, 0.4), (sheets[0], 0.35), (sheets[1], 0.35)]):
        shown.page.mouse.click(*shown.place(panel, 0.52, y))
        assert shown.marked(panel, "pin")["vertex"] == front_vertex(mesh, shown.size(panel), 0.52, y)
    assert shown.said == []
    shown.context.close()


def test_a_report_makes_its_viewers_when_they_come_near(browser: Any, tmp_path: Path) -> None:
    viewer = Viewer([Panel(SOURCE, position_colors(SOURCE))])
    write_html(tmp_path / "report.html", report_html("r", [Section(str(i), [viewer]) for i in range(4)]))
    started = "[...document.querySelectorAll('.viewer')].filter((root) => root.viewer).length"
    shown = Shown(browser, tmp_path / "report.html").open(f"{started} > 0")
    assert shown.page.evaluate(started) < 4
    shown.page.locator(".viewer").nth(3).scroll_into_view_if_needed()
    shown.wait("[...document.querySelectorAll('.viewer')].at(-1).viewer?.panels[0].frame")
    assert covered(shown.picture(3)) > 0.05
    assert shown.said == []
    shown.context.close()


def test_without_webgl_a_sentence_says_so_and_the_text_stays(browser: Any, path: Path) -> None:
    shown = Shown(browser, path)
    shown.page.add_init_script("HTMLCanvasElement.prototype.getContext = () => null")
    shown.open("document.querySelector('.dead')")
    assert "This browser cannot show the meshes: it has no WebGL 2." in shown.text()
    assert shown.page.get_by_text("Much more to read").is_visible()
    assert shown.page.get_by_text("Half of it is right").is_visible()
    assert not shown.page.locator(".bar").is_visible()
    assert shown.said == []
    shown.context.close()
