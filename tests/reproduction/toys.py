"""A set of small bodies in two triangulations, with landmarks, for the tests of studies."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from csm.data.shapes import Shape
from csm.data.store import Store
from csm.mesh.correspondence import PointMap
from csm.mesh.remesh import refine
from csm.mesh.shape import Mesh
from csm.reproduction.bodies import Bodies
from csm.reproduction.study import Context
from tests.shapes import blob


@dataclass(frozen=True)
class Toys:
    """Smooth deformations of one blob of 162 vertices, refined if `n_vertices` is greater; vertex i is one point."""

    names: tuple[str, ...] = ("toy0", "toy1", "toy2")
    n_vertices: int = 162

    @property
    def name(self) -> str:
        return f"toys_{self.n_vertices}"

    def load(self, name: str) -> Shape:
        base, number = blob(2), self.names.index(name)
        rng = np.random.default_rng(0)
        bend = 0.04 * np.sin(base.vertices @ rng.normal(size=(3, 3)) + number)
        mesh = Mesh(base.vertices + bend, base.faces, name)
        if self.n_vertices > 162:
            mesh = refine(mesh, self.n_vertices).mesh
        return Shape(mesh, PointMap.identity(162, mesh.n_vertices))


def toy_bodies() -> Bodies:
    """Return the toys, and refined to 300 vertices; the landmarks are the ends of the x axis."""
    others = {"300 vertices": Toys(n_vertices=300)}
    x = blob(2).vertices[:, 0]
    landmarks = {"left": int(x.argmin()), "right": int(x.argmax())}
    return Bodies("toys", Toys(), others, "toy0", "toy1", "toy2", landmarks, "y")


def toy_context(folder: Path) -> Context:
    """Return a context whose data folder is empty."""
    return Context(folder / "data", folder / "out", Store(folder / "store"))


def measure_no_more(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let everything fail that the engine would measure from now on."""
    monkeypatch.setattr("csm.evaluation.targets.target_errors", lambda *_, **__: pytest.fail("measured again"))
