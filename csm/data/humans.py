"""The built-in humans: 10 people in 10 poses with one connectivity, free to use (see csm/assets/humans.md)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from importlib import resources
from typing import overload

import numpy as np

from csm._types import Arrays, FloatArray, IntArray
from csm.errors import DataError
from csm.mesh.correspondence import Direction, PointMap
from csm.mesh.shape import Mesh


@dataclass(frozen=True)
class Subject:
    """One person: the parameters of the body model, each in 0..1.

    `gender` runs from male (0) to female (1), `age` over child (1/3), young adult (2/3) and old (1).
    """

    number: int
    gender: float
    age: float
    muscle: float
    weight: float
    height: float
    proportions: float


@dataclass(frozen=True, eq=False)
class Humans(Sequence[Mesh]):
    """A sequence of the built-in shapes that decodes a mesh when it is asked for.

    Shape number 10 s + p is person s in pose p, named as in "s03_p07"; units are metres, z points up.
    Vertex i is the same point of the body in every shape.

    Parameters
    ----------
    arrays
        The arrays of the asset, as `read_asset` gives them.
    """

    arrays: Arrays

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of all shapes, in order."""
        return tuple(
            f"s{s:02d}_p{p:02d}" for s in range(len(self.arrays["subjects"])) for p in range(len(self.arrays["poses"]))
        )

    @cached_property
    def poses(self) -> tuple[str, ...]:
        """What pose 0, 1, ... is, such as "arms_up"."""
        return tuple(str(p) for p in self.arrays["poses"])

    @cached_property
    def subjects(self) -> tuple[Subject, ...]:
        """The people."""
        keys = [str(k) for k in self.arrays["phenotypes"]]
        return tuple(
            Subject(s, **dict(zip(keys, row.tolist(), strict=True))) for s, row in enumerate(self.arrays["subjects"])
        )

    @cached_property
    def faces(self) -> IntArray:
        """The common connectivity, shape (M, 3), counter-clockwise seen from outside."""
        return self.arrays["faces"].astype(np.int64)

    @property
    def n_vertices(self) -> int:
        """Number of vertices of every shape, N."""
        return int(self.arrays["differences"].shape[1])

    def mesh(self, name: str) -> Mesh:
        """Return the shape of this name.

        Raises
        ------
        DataError
            If there is no such shape.
        """
        if name not in self.names:
            raise DataError(
                f"built-in humans: there is no {name!r}; the names run from {self.names[0]} to {self.names[-1]}"
            )
        return self[self.names.index(name)]

    def mirror(self) -> PointMap:
        """Return the left-right flipped map of the template: vertex i goes to the same place on the other side.

        It is exact, its own inverse, and maps the connectivity onto itself.
        """
        mirror = self.arrays["mirror"].astype(np.int64)
        return PointMap(mirror, Direction.TEMPLATE_TO_SHAPE, len(mirror), "mirror of the built-in humans")

    def __len__(self) -> int:
        return len(self.names)

    @overload
    def __getitem__(self, key: int) -> Mesh: ...
    @overload
    def __getitem__(self, key: slice) -> Sequence[Mesh]: ...
    def __getitem__(self, key: int | slice) -> Mesh | Sequence[Mesh]:
        if isinstance(key, slice):
            return [self[k] for k in range(len(self))[key]]
        index = range(len(self))[key]
        return Mesh(self._vertices(index), self.faces, self.names[index])

    def _vertices(self, index: int) -> FloatArray:
        levels = np.cumsum(self.arrays["differences"][index], axis=0, dtype=np.uint16)
        vertices: FloatArray = self.arrays["offset"][index] + self.arrays["step"][index] * levels
        return vertices


@lru_cache(maxsize=1)
def load_humans() -> Humans:
    """Return the built-in humans; the file is read once per process.

    Examples
    --------
    >>> humans = load_humans()
    >>> len(humans), humans.mesh("s03_p02").name, humans.poses[2]
    (100, 's03_p02', 'arms_up')
    """
    return Humans(read_asset())


def mirror() -> PointMap:
    """Return the exact left-right map of the template of the built-in humans; see `Humans.mirror`."""
    return load_humans().mirror()


def read_asset() -> Arrays:
    """Read csm/assets/humans.npz from the installed package.

    The arrays are `differences` (S, N, 3) uint16: vertex coordinates in steps, as differences along the vertices modulo
    2**16; `offset` (S, 3) and `step` (S,) in metres; `faces` (M, 3); `mirror` (N,); `subjects` (people, parameters);
    `phenotypes`, `poses`: names; `seed`.

    Raises
    ------
    DataError
        If the file is missing from the installation.
    """
    asset = resources.files("csm") / "assets" / "humans.npz"
    if not asset.is_file():
        raise DataError("csm/assets/humans.npz is missing from this installation of csm; install the package again")
    with asset.open("rb") as file, np.load(file, allow_pickle=False) as archive:
        return {key: archive[key] for key in archive.files}
