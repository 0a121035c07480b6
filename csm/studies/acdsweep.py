"""Matching errors of many settings of ACD on a couple of shapes, which share eigenproblems and a resumable file."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from csm._types import FloatArray
from csm.data.shapeset import Shape, ShapeSet
from csm.descriptors.chebyshev import ACD
from csm.evaluation.distances import MatchedPoints, target_errors
from csm.evaluation.matching import nearest
from csm.mesh.correspondence import ground_truth
from csm.mesh.io import atomic_path
from csm.operators.bundle import Operators
from csm.operators.geodesic import Method


@dataclass(frozen=True)
class Task:
    """Two shapes that are matched both ways.

    Parameters
    ----------
    shapes
        The set.
    couple
        Two names.
    folder
        Where the errors are kept, in one file per task.
    points
        How many corresponding points are measured, drawn without replacement.
    seed
        Of the draw.
    distance
        Kind of geodesic distance.
    """

    shapes: ShapeSet
    couple: tuple[str, str]
    folder: Path
    points: int
    seed: int = 0
    distance: Method = "exact"

    @property
    def path(self) -> Path:
        """File of the errors."""
        first, second = self.couple
        name = f"{self.shapes.name}_{first}_{second}_points{self.points}_seed{self.seed}_{self.distance}.json"
        return self.folder / name

    def errors(self, settings: Sequence[ACD]) -> FloatArray:
        """Return the mean errors of each setting in both directions, (S, 2), as fractions of the target's diameter.

        What the file has is taken from it, the rest is measured and added to it.
        """
        first, second = (self.shapes.load(name) for name in self.couple)
        geometry = [first.mesh.digest, second.mesh.digest]
        known = self._read(geometry)
        missing = [setting for setting in settings if _text(setting) not in known]
        if missing:
            measured = couple_errors(first, second, missing, self)
            known |= {_text(s): row.tolist() for s, row in zip(missing, measured, strict=True)}
            with atomic_path(self.path) as temporary:
                temporary.write_text(json.dumps({"geometry": geometry, "errors": known}, indent=0), encoding="utf-8")
        return np.array([known[_text(setting)] for setting in settings])

    def _read(self, geometry: list[str]) -> dict[str, list[float]]:
        """Return what is kept of these very meshes."""
        if not self.path.is_file():
            return {}
        content: dict[str, Any] = json.loads(self.path.read_text(encoding="utf-8"))
        return dict(content["errors"]) if content["geometry"] == geometry else {}


def _text(setting: ACD) -> str:
    return json.dumps(setting.parameters(), sort_keys=True)


def couple_errors(first: Shape, second: Shape, settings: Sequence[ACD], task: Task) -> FloatArray:
    """Match two shapes both ways by every setting and return the mean errors, (S, 2), as `Task.errors` does."""
    truth = ground_truth(first.truth, second.truth)
    chosen = np.random.default_rng(task.seed).permutation(len(truth.source))[: task.points]
    points = truth.source[chosen], truth.target[chosen]
    operators = Operators(first.mesh), Operators(second.mesh)
    onto_first: dict[ACD, MatchedPoints] = {}
    onto_second: dict[ACD, MatchedPoints] = {}
    for setting in sorted(settings, key=lambda s: s.k, reverse=True):  # longer spectra serve the shorter ones
        here, there = (setting(shape).values.astype(np.float32) for shape in operators)
        onto_second[setting] = MatchedPoints(points[1], nearest(here[points[0]], there))
        onto_first[setting] = MatchedPoints(points[0], nearest(there[points[1]], here))
    errors = [
        target_errors(mesh, task.distance, "diameter", [matched[setting] for setting in settings])
        for mesh, matched in ((second.mesh, onto_second), (first.mesh, onto_first))
    ]
    return np.array([[p.distance.mean() / e.lengths.diameter for p in e.errors] for e in errors]).T
