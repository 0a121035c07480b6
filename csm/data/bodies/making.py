"""Bodies of the parametric model `anny`, with the vertices and faces of the built-in humans.

The built-in humans are a simplified `anny`; csm/assets/humans_anny.npz has the numbers of the vertices they kept.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from importlib import resources
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

import numpy as np

from csm._extras import install_line
from csm._types import FloatArray, IntArray
from csm.data.bodies.drawing import Person, draw_person, draw_pose
from csm.data.bodies.rig import Pose, Rig, pose_matrices
from csm.data.humans import load_humans
from csm.errors import ConfigError
from csm.mesh.intersections import intersecting_pairs

if TYPE_CHECKING:
    import anny

VERSION = "0.6.2"
"""Of anny, whose vertices are those that the built-in humans were made of."""

MOST_INTERSECTIONS = 60
"""Pairs of faces that may cut through each other; creases of groin and armpits have some tens."""

_TRIES = 50
_JOINTS = 40  # more than any pose has


def require_anny() -> None:
    """Raise a `ConfigError` if the body model is not installed, or in another version."""
    try:
        found = version("anny")
    except PackageNotFoundError as error:
        raise ConfigError(f"bodies are made with anny, which is not installed: {install_line('prep')}") from error
    if found != VERSION:
        raise ConfigError(f"bodies are made with anny {VERSION}, here is {found}: pip install anny=={VERSION}")


def versions() -> list[str]:
    """Return what bodies depend on: names of libraries and their versions."""
    return [f"anny {VERSION}", f"torch {version('torch')}"]


def body_model() -> anny.Anny:
    """Return the body model; its first start on a machine takes a minute or two.

    Raises
    ------
    ConfigError
        If `anny` is not installed, or in another version.
    """
    require_anny()
    with _quiet():
        import anny

        return anny.Anny(local_changes="default")


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep what libraries print at their start away from the output."""
    with open(os.devnull, "w") as nowhere, redirect_stdout(nowhere), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


class BodyMaker:
    """Makes bodies with the connectivity of the built-in humans.

    Parameters
    ----------
    model
        As `body_model` gives it.
    """

    def __init__(self, model: Any) -> None:
        self.model = model
        self.faces = load_humans().faces
        self.kept = _kept()

    def body(self, person: Person, pose: Pose, jitter: FloatArray | None = None) -> FloatArray:
        """Return the vertices of a person in a pose, (N, 3), metres, standing on the ground."""
        return standing(self._posed(person, pose, jitter)[self.kept])

    def drawn(self, seed: int, number: int) -> FloatArray:
        """Return body `number` of those drawn with a seed; bodies that cut through themselves are drawn again.

        Raises
        ------
        ConfigError
            If none of 50 draws is sound.
        """
        rng = np.random.default_rng([seed, number])
        for _ in range(_TRIES):
            person, pose = draw_person(rng), draw_pose(rng)
            vertices = self.body(person, pose)
            if len(intersecting_pairs(vertices, self.faces)) <= MOST_INTERSECTIONS:
                return vertices
        raise ConfigError(f"body {number} of seed {seed} cuts through itself in {_TRIES} draws; take another seed")

    def _posed(self, person: Person, pose: Pose, jitter: FloatArray | None = None) -> FloatArray:
        options = {"phenotype_kwargs": person.phenotype, "local_changes_kwargs": person.local}
        with _quiet():
            rest = self.model(**options)
            heads = rest["bone_poses"][0, :, :3, 3].detach().double().numpy()
            rig = Rig(list(self.model.bone_labels), [int(k) for k in self.model.bone_parents], heads)
            noise = np.zeros((_JOINTS, 3)) if jitter is None else jitter
            matrices = pose_matrices(pose, person.lift, noise, rig)[None]
            tensor = self.model.template_vertices.new_tensor(matrices)
            posed = self.model(pose_parameters=tensor, **options)
        vertices: FloatArray = posed["vertices"][0].detach().double().numpy()
        return vertices


def _kept() -> IntArray:
    """Return the vertex of anny that each vertex of the built-in humans was, (N,)."""
    with (resources.files("csm") / "assets" / "humans_anny.npz").open("rb") as file, np.load(file) as archive:
        kept: IntArray = archive["kept"].astype(np.int64)
    return kept


def standing(vertices: FloatArray) -> FloatArray:
    """Put the lowest point on the ground and the middle of the bounding box on the vertical axis."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    moved: FloatArray = vertices - [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, low[2]]
    return moved
