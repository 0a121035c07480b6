"""Matching errors of many descriptors on a couple of shapes, which share eigenproblems and a resumable file."""

from __future__ import annotations

import json
import logging
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from csm._processes import run_all
from csm._types import FloatArray
from csm.data.datasets import find_set
from csm.data.humansset import HumansSet
from csm.data.shapeset import Shape, ShapeSet
from csm.descriptors.base import Descriptor, eigenpairs, record
from csm.errors import ConfigError, DataError
from csm.evaluation.distances import MatchedPoints, target_errors
from csm.evaluation.matching import nearest
from csm.mesh.correspondence import ground_truth
from csm.mesh.io import atomic_path
from csm.operators.geodesic import Method
from csm.operators.operators import Operators
from csm.studies.study import Context

PERSONS, POSES = 8, 10
"""Of the training shapes, which come person by person."""

_log = logging.getLogger(__name__)


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

    def errors(self, settings: Sequence[Descriptor]) -> FloatArray:
        """Return the mean errors of each descriptor in both directions, (S, 2), as fractions of the target's diameter.

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


def _text(setting: Descriptor) -> str:
    return json.dumps(record(setting), sort_keys=True)


def couple_errors(first: Shape, second: Shape, settings: Sequence[Descriptor], task: Task) -> FloatArray:
    """Match two shapes both ways by every descriptor and return the mean errors, (S, 2), as `Task.errors` does."""
    truth = ground_truth(first.truth, second.truth)
    chosen = np.random.default_rng(task.seed).permutation(len(truth.source))[: task.points]
    points = truth.source[chosen], truth.target[chosen]
    operators = Operators(first.mesh), Operators(second.mesh)
    onto_first: dict[Descriptor, MatchedPoints] = {}
    onto_second: dict[Descriptor, MatchedPoints] = {}
    for setting in sorted(settings, key=eigenpairs, reverse=True):  # the longest spectrum serves the others
        here, there = (setting(shape).values.astype(np.float32) for shape in operators)
        onto_second[setting] = MatchedPoints(points[1], nearest(here[points[0]], there))
        onto_first[setting] = MatchedPoints(points[0], nearest(there[points[1]], here))
    errors = [
        target_errors(mesh, task.distance, "diameter", [matched[setting] for setting in settings])
        for mesh, matched in ((second.mesh, onto_second), (first.mesh, onto_first))
    ]
    return np.array([[p.distance.mean() / e.lengths.diameter for p in e.errors] for e in errors]).T


def training_errors(
    context: Context,
    shapes: ShapeSet,
    settings: Sequence[Descriptor],
    folder: str,
    *,
    n_pairs: int,
    points: int,
    distance: Method,
) -> dict[Descriptor, FloatArray]:
    """Return the errors of each descriptor over pairs of `same_person_couples`, (n_pairs,), in thousandths.

    What was measured of a couple is kept in `folder`, below that of the artefacts.
    """
    couples = same_person_couples(shapes.names, n_pairs, context.seed)
    tasks = [Task(shapes, pair, context.out / folder, points, context.seed, distance) for pair in couples]
    errors = measure(tasks, list(dict.fromkeys(settings)), context.workers)
    return {setting: 1000 * values for setting, values in errors.items()}


def averaged(errors: FloatArray) -> dict[str, Any]:
    """Return what a row of a table says of errors over pairs: their mean, its standard error, and themselves."""
    return {
        "error": float(errors.mean()),
        "standard error": float(errors.std(ddof=1) / np.sqrt(len(errors))),
        "pairs": errors.tolist(),
    }


def measure(tasks: Sequence[Task], settings: Sequence[Descriptor], workers: int) -> dict[Descriptor, FloatArray]:
    """Return the mean errors of each descriptor over all ordered pairs, task by task, shape (n_pairs,)."""
    errors = run_all(
        partial(Task.errors, settings=settings),
        tasks,
        lambda task: " and ".join(task.couple),
        workers,
        what="couples",
        unit="couple",
    )
    return dict(zip(settings, np.concatenate(errors, axis=1), strict=True))


def same_person_couples(names: Sequence[str], n_pairs: int, seed: int) -> list[tuple[str, str]]:
    """Return n_pairs / 2 couples of poses, spread evenly over the persons; no shape twice while there are others.

    Parameters
    ----------
    names
        Of all shapes, person by person; only those of the training persons are used.
    n_pairs
        Twice the number of couples, since each is matched both ways.
    seed
        Of the draw.

    Raises
    ------
    ConfigError
        If `n_pairs` is odd, not positive, or more than there are.

    Examples
    --------
    >>> same_person_couples([str(i) for i in range(100)], 4, seed=0)
    [('4', '6'), ('12', '19')]
    """
    people = [names[start : start + POSES] for start in range(0, PERSONS * POSES, POSES)]
    people = [poses for poses in people if len(poses) >= 2]
    most = 2 * sum(len(poses) // 2 for poses in people)
    if n_pairs < 2 or n_pairs % 2 or n_pairs > most:
        raise ConfigError(f"n_pairs={n_pairs}; wanted an even number from 2 to {most}")
    rng = np.random.default_rng(seed)
    orders = [rng.permutation(len(poses)) for poses in people]
    found = []
    for turn in range(POSES // 2):
        for poses, order in zip(people, orders, strict=True):
            if 2 * turn + 1 < len(poses):
                found.append((poses[order[2 * turn]], poses[order[2 * turn + 1]]))
    return found[: n_pairs // 2]


def training_shapes(context: Context) -> ShapeSet:
    """Return remeshed FAUST if it is below the root of the data, else remeshed built-in humans."""
    try:
        return find_set(context.root, "FAUST_5k_remeshed")
    except DataError as error:
        _log.info("the built-in humans are taken: %s", error)
        return HumansSet("remeshed", 5000, str(context.store.root))
