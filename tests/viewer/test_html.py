"""Pages: whole, alone, escaped, and with everything in them that was put in."""

from __future__ import annotations

import base64
import io
import re
from html.parser import HTMLParser
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from csm.data.humans import load_humans
from csm.errors import ConfigError
from csm.viewer.colors import position_colors
from csm.viewer.html import Code, Figure, Panel, Section, Table, Text, Viewer, report_html, viewer_html, write_html
from tests.shapes import sphere

VOID = {"meta", "img", "br", "hr", "link", "input"}
NASTY = "<img src=x onerror=alert(1)>\"' & `<b>`"


class Page(HTMLParser):
    """A page that is read strictly: every tag is closed in order."""

    def __init__(self, html: str) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str]]] = []
        self.text: dict[str, list[str]] = {}
        self.feed(html)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, {name: value or "" for name, value in attrs}))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open:
            self.text.setdefault(self.open[-1], []).append(data)

    def attributes(self, tag: str) -> list[dict[str, str]]:
        return [attributes for name, attributes in self.tags if name == tag]


def a_viewer() -> Viewer:
    return Viewer([Panel(sphere(1), position_colors(sphere(1)))])


def a_page(text: str = "text") -> str:
    picture = np.random.default_rng(0).integers(0, 255, (6, 8, 3), dtype=np.uint8)
    blocks = [Text(text), Code(text), Table([text], [[text]], text), Figure(picture, text), a_viewer()]
    return report_html(text, [Section(text, blocks)] * 4, lead=text, footer=text)


def test_page_is_well_formed_html() -> None:
    page = Page(a_page())
    assert a_page().startswith("<!doctype html>")
    assert len(page.attributes("section")) == 4
    assert {f"#{s['id']}" for s in page.attributes("section")} == {a["href"] for a in page.attributes("a")}


def test_page_asks_for_nothing_from_anywhere() -> None:
    html = a_page()
    written = re.sub(r'<script type="application/json">.*?</script>', "", html.split("<script>")[0])
    assert not re.search(r"https?:|//[a-z]|@import|url\(", written)
    assert not re.search(r"https?:|\bfetch\b|XMLHttpRequest|import\(|WebSocket|sendBeacon", html)
    for _, attributes in Page(html).tags:
        for name in ("src", "href", "action", "srcset", "poster"):
            assert attributes.get(name, "#").startswith(("data:image/png;base64,", "#"))
    policy = next(m["content"] for m in Page(html).attributes("meta") if m.get("http-equiv"))
    assert "default-src 'none'" in policy
    assert "http" not in policy


def test_text_of_the_caller_stays_text() -> None:
    page = Page(a_page(NASTY))
    assert [i for i in page.attributes("img") if not i["src"].startswith("data:image/png")] == []
    assert not any(name.startswith("on") for _, attributes in page.tags for name in attributes)
    assert page.attributes("b") == []
    assert NASTY in page.text["title"]
    assert page.attributes("img")[0]["alt"] == NASTY


def test_code_and_bold_are_set_and_code_stays_as_it_is() -> None:
    page = Page(report_html("t", [Section("s", [Text("run `a **b** < c` and **wait**\n\nthen go")])]))
    assert page.text["strong"] == ["wait"]
    assert page.text["code"] == ["a **b** < c"]
    assert [p for p in page.text["p"] if "go" in p] == ["then go"]


def test_numbers_stand_to_the_right() -> None:
    rows = [["CSMCNN", "**9.7 ± 0.3**", "88.1 %", 20, "1e-3"], ["ACD", "56.0", "-", 380, "0"]]
    page = Page(report_html("t", [Section("s", [Table(list("abcde"), rows)])]))
    cells = [attributes.get("class") for attributes in page.attributes("td")]
    assert cells == 2 * [None, *4 * ["number"]]


def test_a_row_with_another_number_of_cells_is_refused() -> None:
    with pytest.raises(ConfigError, match="row 1 has 1 cells"):
        Table(["a", "b"], [[1, 2], [3]])


def test_pictures_are_inside_the_page() -> None:
    picture = np.random.default_rng(0).integers(0, 255, (6, 8, 4), dtype=np.uint8)
    page = Page(report_html("t", [Section("s", [Figure(picture, "two bodies"), Figure(picture, width=300)])]))
    first, second = page.attributes("img")
    data = base64.b64decode(first["src"].removeprefix("data:image/png;base64,"))
    np.testing.assert_array_equal(np.asarray(Image.open(io.BytesIO(data))), picture)
    assert (first["alt"], first["width"], second["width"]) == ("two bodies", "4", "300")


def test_only_a_page_with_meshes_has_a_script() -> None:
    assert "WebGL" not in report_html("t", [Section("s", [Text("x")])])
    page = Page(viewer_html("t", a_viewer(), text="protocol: all pairs"))
    assert len(page.attributes("canvas")) == 1
    assert page.attributes("script") == [{"type": "application/json"}, {}]
    assert "protocol: all pairs" in page.text["p"]


def test_a_page_of_meshes_says_the_most_important_first_and_the_rest_below_them() -> None:
    page = viewer_html("t", a_viewer(), lead="Most of it is wrong.", text="How it was made.")
    assert page.index("Most of it is wrong.") < page.index("<canvas") < page.index("How it was made.")


def test_page_of_two_usual_meshes_with_everything_is_small() -> None:
    body = load_humans().mesh("s00_p00")
    assert body.n_vertices > 6500
    rng, n = np.random.default_rng(0), body.n_vertices
    values, features = rng.random(n), rng.normal(size=(n, 300))
    panel = Panel(body, position_colors(body), "source", rng.permutation(n), values, values, features)
    page = viewer_html("t", Viewer([panel, Panel(body, position_colors(body), features=features)], reference=1))
    assert len(page.encode()) < 2e6


def test_every_part_of_the_script_is_in_the_page() -> None:
    page = viewer_html("t", a_viewer())
    parts = [p for p in (files("csm.viewer") / "web").iterdir() if p.name.endswith(".js")]
    assert len(parts) > 5
    assert [p.name for p in parts if page.count(p.read_text(encoding="utf-8")) != 1] == []


def test_long_pages_have_contents_and_short_ones_do_not() -> None:
    sections = [Section(str(i), []) for i in range(4)]
    assert len(Page(report_html("t", sections)).attributes("a")) == 4
    assert Page(report_html("t", sections[:3])).attributes("nav") == []


def test_page_is_written_whole(tmp_path: Path) -> None:
    write_html(tmp_path / "new" / "page.html", viewer_html("Größe ±", a_viewer()))
    assert [p.name for p in (tmp_path / "new").iterdir()] == ["page.html"]
    assert "<title>Größe ±</title>" in (tmp_path / "new" / "page.html").read_text(encoding="utf-8")
