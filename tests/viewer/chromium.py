"""Chromium for tests, and what a page shows in it."""

from __future__ import annotations

import base64
import io
import os
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from csm.mesh.shape import Mesh
from csm.viewer.camera import View, body_axes, rotation

VIEW = View(up="z", azimuth=20, elevation=10)
"""How the tests look at meshes at first."""

_NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
_FLAGS = [
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
READY = "[...document.querySelectorAll('.viewer')].every((root) => root.viewer?.panels.every((panel) => panel.frame))"


def find_browser() -> str | None:
    """Return the program, from `CSM_CHROMIUM` or the PATH."""
    return os.environ.get("CSM_CHROMIUM") or next(filter(None, map(shutil.which, _NAMES)), None)


@contextmanager
def chromium() -> Iterator[Any]:
    """Start the browser, or skip the test that wants it."""
    playwright = pytest.importorskip("playwright.sync_api", reason='needs pip install "csm-correspondence[browser]"')
    program = find_browser()
    if program is None:
        pytest.skip("there is no Chromium or Chrome on the PATH, and CSM_CHROMIUM names none")
    with playwright.sync_playwright() as started:
        browser = started.chromium.launch(executable_path=program, args=_FLAGS)
        yield browser
        browser.close()


class Shown:
    """A page in a window of its own, with all that it said and asked for."""

    def __init__(self, browser: Any, path: Path, size: tuple[int, int] = (1280, 720), **options: Any) -> None:
        self.context = browser.new_context(viewport={"width": size[0], "height": size[1]}, **options)
        self.page = self.context.new_page()
        self.said: list[str] = []
        self.asked: list[str] = []
        self.page.on("console", lambda message: self.said.append(message.text))
        self.page.on("pageerror", lambda error: self.said.append(str(error)))
        self.page.on("request", lambda request: self.asked.append(request.url))
        self.path = path

    def open(self, until: str = READY) -> Shown:
        """Load the page and wait until its meshes are painted."""
        self.page.goto(self.path.as_uri())
        self.wait(until)
        return self

    def wait(self, until: str, seconds: float = 30) -> None:
        """Wait until an expression is true; the page's own policy forbids it to wait for text that is run."""
        end = time.monotonic() + seconds
        while not self.page.evaluate(until):
            assert time.monotonic() < end, f"still not so after {seconds} seconds: {until}"
            time.sleep(0.02)

    def box(self, panel: int = 0) -> tuple[float, float, float, float]:
        """Return left, top, width and height of a panel's picture."""
        box = self.page.locator("canvas").nth(panel).bounding_box()
        return box["x"], box["y"], box["width"], box["height"]

    def size(self, panel: int) -> tuple[int, int]:
        """Return width and height of a panel's picture in its own pixels."""
        width, height = self.page.locator("canvas").nth(panel).evaluate("(c) => [c.width, c.height]")
        return int(width), int(height)

    def camera(self, what: str) -> float:
        """Return a number of the camera."""
        return float(self.page.evaluate(f"document.querySelector('.viewer').viewer.camera.{what}"))

    def place(self, panel: int, x: float = 0.5, y: float = 0.5) -> tuple[float, float]:
        """Return a place of the window, from fractions of a panel's picture."""
        left, top, width, height = self.box(panel)
        return left + x * width, top + y * height

    def settle(self) -> None:
        """Wait until what was asked for is painted."""
        self.page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")

    def text(self, of: str = ".readout") -> str:
        """Return what the page says of a vertex."""
        self.settle()
        return " ".join(self.page.locator(of).inner_text().split())

    def marked(self, panel: int, kind: str) -> dict[str, Any]:
        """Return vertex and place of a ring, in pixels of the panel's picture, and whether it is broken."""
        self.settle()
        ring = self.page.locator(".view").nth(panel).locator(f".mark.{kind}:not(.dot)")
        style = ring.evaluate("(m) => [m.dataset.vertex, m.style.left, m.style.top, m.classList.contains('hidden')]")
        return {
            "vertex": int(style[0]),
            "place": np.array([float(x.removesuffix("px")) for x in style[1:3]]),
            "hidden": style[3],
        }

    def picture(self, panel: int) -> np.ndarray:
        """Return what is painted of a mesh, with its opacity, (H, W, 4), as floats from 0 to 1."""
        self.settle()
        data = self.page.locator("canvas").nth(panel).evaluate("(canvas) => canvas.toDataURL()")
        return np.asarray(Image.open(io.BytesIO(base64.b64decode(data.partition(",")[2])))) / 255

    def mode(self, name: str) -> None:
        """Choose what the colours show."""
        self.page.click(f"[data-mode={name}]")
        self.settle()


def seen(mesh: Mesh, size: tuple[int, int], view: View = VIEW) -> np.ndarray:
    """Project vertices to pixels of a picture and to nearness, (N, 3), as the page is meant to."""
    centred = mesh.vertices - (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2
    right, up, front = body_axes(mesh, view.up) @ centred.T
    scale = 0.47 * min(size[0] / np.hypot(right, front).max(), size[1] / np.abs(up).max())
    return scale * centred @ rotation(mesh, view).T * [1, -1, 1] + [size[0] / 2, size[1] / 2, 0]


def front(mesh: Mesh, points: np.ndarray, x: float, y: float) -> tuple[np.ndarray, np.ndarray]:
    """Find the nearest face under a pixel by going through all; return its corners and how much each has of it."""
    a, b, c = (points[mesh.faces[:, k]] - [x, y, 0] for k in range(3))
    weights = np.stack([p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0] for p, q in ((b, c), (c, a), (a, b))], axis=1)
    weights = weights / weights.sum(axis=1, keepdims=True)
    near = np.where((weights >= 0).all(axis=1), (weights * points[mesh.faces, 2]).sum(axis=1), -np.inf)
    return mesh.faces[near.argmax()], weights[near.argmax()]


def front_vertex(mesh: Mesh, size: tuple[int, int], x: float, y: float, view: View = VIEW) -> int:
    """Find the vertex that is seen at a place, given as fractions of the picture."""
    corners, weights = front(mesh, seen(mesh, size, view), int(x * size[0]) + 0.5, int(y * size[1]) + 0.5)
    return int(corners[weights.argmax()])
