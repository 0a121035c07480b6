"""The built-in humans: 10 people in 10 poses with one connectivity, free to use (see csm/assets/humans.md).

As a set of shapes they come as they are, refined (the original vertices first, as LPS-data does with FAUST) or remeshed
(other vertices and triangles altogether, as LRVD does), always with exact ground truth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from importlib import resources
from pathlib import Path
from typing import Any, ClassVar, overload

import numpy as np

from csm._types import Arrays, IntArray
from csm.data.base import DataModule, DataSet
from csm.data.packed import unpack
from csm.data.shapes import Shape
from csm.data.splits import Split, as_split
from csm.data.store import Store
from csm.data.variants import FORMS, VariantSet, Variation
from csm.errors import ConfigError, DataError
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

    def __repr__(self) -> str:
        return f"Humans({len(self)} shapes: {len(self.subjects)} people in {len(self.poses)} poses)"

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
        return Mesh(unpack(self.arrays, index), self.faces, self.names[index])


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


def read_asset() -> Arrays:
    """Read csm/assets/humans.npz from the installed package.

    The arrays are those of `csm.data.packed.pack` in metres; `faces` (M, 3); `mirror` (N,); `subjects` (people,
    parameters); `phenotypes`, `poses`: names; `seed`.

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


class HumansSet:
    """The built-in humans over the template of their common connectivity."""

    name: ClassVar[str] = "humans"
    built_in: ClassVar[bool] = True

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the shapes, person by person: "s00_p00" to "s09_p09"."""
        return load_humans().names

    def load(self, name: str) -> Shape:
        """Return one shape."""
        humans = load_humans()
        mesh = humans.mesh(name)
        return Shape(mesh, PointMap.identity(mesh.n_vertices, name=name), humans.mirror())


def humans_set(text: str = "original", store_root: str | None = None) -> HumansSet | VariantSet:
    """Return the built-in humans by a short name: "original", or another form such as "refined_10000" or "cut_30".

    Parameters
    ----------
    text
        "original", or what `csm.data.variants.Variation.parse` reads.
    store_root
        Folder of the store that keeps the other forms; None for the default one.

    Raises
    ------
    ConfigError
        If the name has another form.

    Examples
    --------
    >>> humans_set("refined_10000").name
    'humans_refined_10000'
    """
    if text == "original":
        return HumansSet()
    if (variation := Variation.parse(str(text))) is None:
        raise ConfigError(f"built-in humans: {text!r} is not the name of a set; wanted original, {FORMS}")
    return VariantSet(HumansSet(), variation, store_root)


def _names(persons: Sequence[int], poses: Sequence[int]) -> tuple[str, ...]:
    return tuple(f"s{person:02d}_p{pose:02d}" for person in persons for pose in poses)


SPLITS = (
    Split(
        "humans_80_20",
        _names(range(8), range(10)),
        _names(range(8, 10), range(10)),
        "csm: persons 0 to 7 of the built-in humans train, 8 and 9 test",
    ),
    Split(
        "humans_demo",
        _names((0, 2, 4, 6), (0, 2, 4, 6, 8)),
        _names((8, 9), (1, 5, 9)),
        "csm: a few of the built-in humans for the demo; persons 8 and 9 and odd poses are unseen",
        validation=_names((5, 7), (1, 5, 9)),
    ),
)


class HumansDataModule(DataModule):
    """The built-in humans, which need no download; tests at other resolutions are made from them.

    Parameters
    ----------
    train
        Set to train on, by a name that `humans_set` reads.
    test
        Sets to test on, likewise.
    split
        A split, its name, or the path of a split file.
    options
        Of `csm.data.base.DataModule`.
    """

    def __init__(
        self,
        train: str = "original",
        test: Sequence[str] = ("original", "refined_10000", "refined_15000", "remeshed_5000"),
        split: str | Path | Split = SPLITS[0].name,
        **options: Any,
    ) -> None:
        store: Store | None = options.get("store")
        root = None if store is None else str(store.root)
        tests = [humans_set(text, root) for text in test]
        super().__init__(humans_set(train, root), tests, as_split(split, SPLITS), **options)


DATA_SET = DataSet(HumansDataModule, splits=SPLITS)
