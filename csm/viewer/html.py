"""Self-contained pages: text, tables, pictures and meshes in one html file that requests nothing from a server.

The page forbids itself every request by a content security policy; whatever a caller gives as text is escaped.
"""

from __future__ import annotations

import base64
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from importlib.resources import files
from string import Template
from typing import TypeAlias

from csm.errors import ConfigError
from csm.mesh.io import atomic_path
from csm.viewer.block import viewer_block
from csm.viewer.picture import Picture, png_bytes
from csm.viewer.scene import Panel, Viewer

__all__ = ["Code", "Figure", "Panel", "Section", "Table", "Text", "Viewer", "report_html", "viewer_html", "write_html"]

_NUMBER = re.compile(r"[-+−]?[\d.,]+(e[-+]?\d+)?( ?± ?[\d.,]+)? ?(%|s|x)?|[-–—]|")
_CONTENTS_FROM = 4
_SCRIPTS = (
    "shaders", "painter", "mesh", "camera", "picking", "colors", "partners", "readout", "marks", "input", "viewer"
)  # fmt: skip


@dataclass(frozen=True)
class Text:
    """Paragraphs, with an empty line between them; ```code``` in backticks and ``**bold**`` are set as such."""

    text: str


@dataclass(frozen=True)
class Code:
    """Lines that are shown as they are, such as a command."""

    text: str


@dataclass(frozen=True)
class Table:
    """A table; columns of numbers are aligned to the right.

    Raises
    ------
    ConfigError
        If a row has another number of cells than there are columns.
    """

    columns: Sequence[str]
    rows: Sequence[Sequence[object]]
    caption: str = ""

    def __post_init__(self) -> None:
        for i, row in enumerate(self.rows):
            if len(row) != len(self.columns):
                raise ConfigError(f"table: row {i} has {len(row)} cells, but there are {len(self.columns)} columns")


@dataclass(frozen=True, eq=False)
class Figure:
    """A picture (H, W, 3 or 4) with a caption; `width` in css pixels, half of W by default so that it is sharp."""

    picture: Picture
    caption: str = ""
    width: int | None = None


Block: TypeAlias = Text | Code | Table | Figure | Viewer


@dataclass(frozen=True, eq=False)
class Section:
    """A heading and what stands below it."""

    title: str
    blocks: Sequence[Block]


def report_html(title: str, sections: Sequence[Section], *, lead: str = "", footer: str = "") -> str:
    """Write a page.

    Parameters
    ----------
    title
        Heading of the page and of its browser tab.
    sections
        In order; from four on there is a list of contents.
    lead
        Paragraphs below the title: what the reader should know first.
    footer
        Small print, such as the command and the versions.
    """
    body = "\n".join(
        f'<section id="s{i}">\n<h2>{_inline(section.title)}</h2>\n'
        + "\n".join(_block(block) for block in section.blocks)
        + "\n</section>"
        for i, section in enumerate(sections)
    )
    alive = any(isinstance(block, Viewer) for section in sections for block in section.blocks)
    header = _header(title, _paragraphs(lead) + _contents(sections))
    return _page(title, f"{header}<main>\n{body}</main>", footer, alive=alive)


def viewer_html(title: str, viewer: Viewer, *, lead: str = "", text: str = "", footer: str = "") -> str:
    """Write a page with one viewer, which fills the window under the title.

    Parameters
    ----------
    title
        Heading of the page and of its browser tab.
    viewer
        The meshes.
    lead
        A sentence above the meshes: what the reader should know first.
    text
        Paragraphs below them that say what is shown and how it was made.
    footer
        Small print.
    """
    top = f'<div class="fold">\n{_header(title, _paragraphs(lead))}{viewer_block(viewer)}\n</div>\n'
    return _page(title, f"<main>\n{top}{_paragraphs(text)}</main>", footer, alive=True)


def _page(title: str, body: str, footer: str, *, alive: bool) -> str:
    return Template(_part("page.html")).substitute(
        title=escape(title),
        body=body,
        footer=_inline(footer),
        style=_part("page.css"),
        script=f"<script>\n{_script()}</script>\n" if alive else "",
    )


def _header(title: str, below: str) -> str:
    return f"<header>\n<h1>{escape(title)}</h1>\n{below}</header>\n"


def _script() -> str:
    """Return the parts of the viewer's script as one, with names of their own."""
    parts = "\n".join(_part(f"{name}.js") for name in _SCRIPTS)
    return f'(() => {{\n"use strict";\n\n{parts}}})();\n'


def write_html(path: str | os.PathLike[str], page: str) -> None:
    """Write a page as UTF-8; the file is written completely or not at all."""
    with atomic_path(path) as temporary:
        temporary.write_text(page, encoding="utf-8")


def _part(name: str) -> str:
    return (files("csm.viewer") / "web" / name).read_text(encoding="utf-8")


def _contents(sections: Sequence[Section]) -> str:
    if len(sections) < _CONTENTS_FROM:
        return ""
    items = "".join(f'<li><a href="#s{i}">{_inline(section.title)}</a></li>' for i, section in enumerate(sections))
    return f"<nav><ul>{items}</ul></nav>\n"


def _block(block: Block) -> str:
    if isinstance(block, Text):
        return _paragraphs(block.text)
    if isinstance(block, Code):
        return f"<pre><code>{escape(block.text)}</code></pre>"
    if isinstance(block, Table):
        return _table(block)
    if isinstance(block, Figure):
        return _figure(block)
    return viewer_block(block)


def _inline(text: str) -> str:
    """Escape text and set `code` and, outside of code, **bold**."""
    parts = re.split(r"`([^`]+)`", escape(text))
    parts[0::2] = [re.sub(r"\*\*([^*]+)\*\*", r"<strong>\1</strong>", part) for part in parts[0::2]]
    parts[1::2] = [f"<code>{part}</code>" for part in parts[1::2]]
    return "".join(parts)


def _paragraphs(text: str) -> str:
    return "".join(f"<p>{_inline(p.strip())}</p>\n" for p in re.split(r"\n\s*\n", text) if p.strip())


def _table(table: Table) -> str:
    rows = [[str(cell) for cell in row] for row in table.rows]
    numeric = [all(_NUMBER.fullmatch(row[k].strip("*")) for row in rows) for k in range(len(table.columns))]
    style = [' class="number"' if right else "" for right in numeric]
    head = "".join(f'<th scope="col"{s}>{_inline(c)}</th>' for s, c in zip(style, table.columns, strict=True))
    body = "\n".join(
        "<tr>" + "".join(f"<td{s}>{_inline(cell)}</td>" for s, cell in zip(style, row, strict=True)) + "</tr>"
        for row in rows
    )
    caption = f"<caption>{_inline(table.caption)}</caption>" if table.caption else ""
    return (
        f'<div class="table" tabindex="0"><table>{caption}<thead><tr>{head}</tr></thead>\n'
        f"<tbody>\n{body}\n</tbody></table></div>"
    )


def _figure(figure: Figure) -> str:
    data = base64.b64encode(png_bytes(figure.picture)).decode("ascii")
    width = figure.width or max(1, figure.picture.shape[1] // 2)
    caption = f"<figcaption>{_inline(figure.caption)}</figcaption>" if figure.caption else ""
    alternative = escape(figure.caption or "figure")
    return f'<figure><img src="data:image/png;base64,{data}" width="{width}" alt="{alternative}">{caption}</figure>'
