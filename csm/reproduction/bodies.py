"""The bodies that the figures show: FAUST where it is there, else the built-in humans, each at several resolutions."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, TypeAlias, get_args

from csm._types import Float32Array
from csm.data.humans import HumansSet, humans_set
from csm.data.prepare import Recipe, features_of, shared_operators
from csm.data.registry import find_set
from csm.data.shapes import Shape, ShapeSet
from csm.data.store import Store
from csm.descriptors.presets import preset
from csm.errors import ConfigError, DataError
from csm.mesh.shape import Mesh
from csm.reproduction.published import RIVALS
from csm.reproduction.study import Context, Study
from csm.viewer.camera import Axis

Source: TypeAlias = Literal["auto", "faust", "humans"]

_log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Bodies:
    """One set of bodies over one template, in its own and in other triangulations.

    Parameters
    ----------
    title
        What captions call the set.
    original
        The bodies as they are.
    others
        The same bodies in other triangulations, by short titles such as "10,000 vertices".
    body, other_pose, other_person
        Names: the one that is looked at, the same person otherwise, and somebody else.
    landmarks
        Name -> template point.
    up
        Axis of the data that points up.
    """

    title: str
    original: ShapeSet
    others: Mapping[str, ShapeSet]
    body: str
    other_pose: str
    other_person: str
    landmarks: Mapping[str, int] = field(default_factory=dict)
    up: Axis | Literal["auto"] = "auto"

    @property
    def resolutions(self) -> dict[str, ShapeSet]:
        """All triangulations, the original one first."""
        return {f"{self.original.load(self.body).mesh.n_vertices:,} vertices": self.original, **self.others}

    @property
    def corresponding(self) -> dict[str, ShapeSet]:
        """Those of the other triangulations whose vertices are known on the same template; the rest is warned of."""
        template, found = self._template_size(self.original), {}
        for title, shapes in self.others.items():
            n = self._template_size(shapes)
            if n == template:
                found[title] = shapes
            else:
                why = f"its template has {n} points, not {template}, so it is left out"
                _log.warning("%s (%s): %s", shapes.name, title, why)
        return found

    def _template_size(self, shapes: ShapeSet) -> int:
        return shapes.load(self.body).truth.as_template_to_shape().n_from


def built_in_bodies(store: Store) -> Bodies:
    """Return the built-in humans, refined to 10,000 and 15,000 vertices and remeshed to 5,000."""
    root = str(store.root)
    others = {
        "10,000 vertices": humans_set("refined_10000", root),
        "15,000 vertices": humans_set("refined_15000", root),
        "5,000 vertices, remeshed": humans_set("remeshed_5000", root),
    }
    landmarks = {"left hand": 4395, "left knee": 5874, "head": 242}
    return Bodies("built-in humans", HumansSet(), others, "s08_p02", "s08_p04", "s07_p00", landmarks, "z")


def faust_bodies(root: Path) -> Bodies:
    """Return FAUST, test person 8, with those of its other triangulations that are there; DataError without FAUST."""
    original = find_set(root, "FAUST_6890", "FAUST_MPI")
    others: dict[str, ShapeSet] = {}
    for title, name in (
        ("10,000 vertices", "FAUST_10000"),
        ("15,000 vertices", "FAUST_15000"),
        ("5,000 vertices, remeshed", "FAUST_5k_remeshed"),
    ):
        try:
            others[title] = find_set(root, name)
        except DataError as error:
            _log.warning("%s is left out: %s", name, error)
    # Points of the SMPL template: tip of the left middle finger, front of the left knee, top of the head.
    landmarks = {"left hand": 2445, "left knee": 1043, "head": 411}
    return Bodies("FAUST", original, others, "tr_reg_080", "tr_reg_089", "tr_reg_090", landmarks, "y")


def find_bodies(source: Source | Bodies, context: Context) -> Bodies:
    """Return the bodies of a source; "auto" takes FAUST if it is below the root of the data, else the built-in humans.

    DataError if FAUST is asked for and not there, ConfigError if there is no such source.
    """
    if isinstance(source, Bodies):
        return source
    if source not in get_args(Source):
        raise ConfigError(f"source={source!r} is unknown; choose {', '.join(get_args(Source))}")
    if source != "humans":
        try:
            return faust_bodies(context.root)
        except DataError as error:
            if source == "faust":
                raise
            _log.info("the built-in humans are taken: %s", error)
    return built_in_bodies(context.store)


def landmark_vertices(bodies: Bodies, shape: Shape) -> dict[str, int]:
    """Return the vertex of each landmark on a shape; ConfigError if one has no counterpart there."""
    truth = shape.truth.as_template_to_shape()
    for name, point in bodies.landmarks.items():
        if not 0 <= point < truth.n_from or truth.indices[point] < 0:
            raise ConfigError(f"landmark {name}: template point {point} has no vertex on {shape.name}")
    return {name: int(truth.indices[point]) for name, point in bodies.landmarks.items()}


def describe(mesh: Mesh, names: Sequence[str], store: Store) -> dict[str, Float32Array]:
    """Return descriptors by their names in the presets, each (N, Q), from the store or computed on shared operators."""
    recipes = {name: Recipe(preset(name), basis_k=0) for name in names}
    operators = shared_operators(mesh, list(recipes.values()), store)
    order = sorted(names, key=lambda name: recipes[name].descriptor.eigenpairs, reverse=True)
    values = {name: features_of(mesh, recipes[name].descriptor, store, operators) for name in order}
    return {name: values[name] for name in names}


@dataclass(frozen=True)
class OnBodies(Study):
    """A study of bodies that figures show.

    Parameters
    ----------
    source
        Of the bodies: "faust", "humans", or "auto" for FAUST where it is there; see `find_bodies`.
    descriptors
        Names of presets, in order.
    """

    source: Source | Bodies = "auto"
    descriptors: tuple[str, ...] = RIVALS
