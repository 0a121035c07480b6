"""A file of made bodies, and the set of shapes that it is."""

from __future__ import annotations

import os
import zipfile
from functools import cached_property, lru_cache, partial
from pathlib import Path

import numpy as np

from csm import __version__
from csm._parallel import parallel_map
from csm._places import load
from csm._types import Arrays, FloatArray
from csm.data.humans import load_humans
from csm.data.packed import pack, unpack
from csm.data.shapes import Shape
from csm.errors import ConfigError, DataError
from csm.mesh.correspondence import PointMap
from csm.mesh.io.files import atomic_path
from csm.mesh.shape import Mesh

FORMAT = "csm bodies 1"
_KEYS = ("format", "differences", "offset", "step", "seed", "versions")


def make_bodies(
    path: str | os.PathLike[str], count: int, seed: int = 0, workers: int = 0, progress: bool = True
) -> Bodies:
    """Make bodies at random, and write them to a file.

    Body k depends on the seed, on k and on the versions of anny and torch, not on the count.

    Parameters
    ----------
    path
        File to write, ``.npz``; about 25 kB a body.
    count
        How many, at least 1.
    seed
        Of the people and poses, from 0 on.
    workers
        Processes; up to 1 works in this one.
    progress
        Show a bar.

    Raises
    ------
    ConfigError
        If `anny` is not installed, or an argument is out of its range.

    Examples
    --------
    >>> make_bodies("bodies.npz", 1000)  # doctest: +SKIP
    Bodies('bodies.npz', 1000 bodies)
    """
    if count < 1 or seed < 0 or not str(path).endswith(".npz"):
        raise ConfigError(
            f"bodies: wanted a file that ends with .npz, a count of at least 1 and a seed of at least 0; got "
            f"{os.fspath(path)}, {count}, {seed}"
        )
    load("csm.data.bodies.making:require_anny")()
    shapes = parallel_map(
        partial(_made, seed), range(count), _name, workers, what="bodies", unit="body", progress=progress
    )
    arrays = pack(np.stack(shapes)) | {
        "format": np.array(FORMAT),
        "seed": np.array(seed),
        "versions": np.array([f"csm {__version__}", *load("csm.data.bodies.making:versions")()]),
    }
    with atomic_path(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **arrays)  # type: ignore[arg-type]
    return Bodies(path)


@lru_cache(maxsize=1)
def _maker() -> object:
    making = load("csm.data.bodies.making:BodyMaker")
    return making(load("csm.data.bodies.making:body_model")())


def _made(seed: int, number: int) -> FloatArray:
    made: FloatArray = _maker().drawn(seed, number)  # type: ignore[attr-defined]
    return made


def _name(number: int) -> str:
    return f"b{number:05d}"


class Bodies:
    """The bodies of a file: a set of shapes over the template of the built-in humans.

    Parameters
    ----------
    path
        As `make_bodies` has written it; it is read when a shape is first asked for, its head at once.

    Raises
    ------
    DataError
        If there is no such file, or it is no file of bodies.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)
        if not self.path.is_file():
            raise DataError(f"{self.path}: there is no such file; `csm bodies {self.path}` makes one")
        self._count = len(self._arrays(("format", "step"))["step"])

    def __repr__(self) -> str:
        return f"Bodies({str(self.path)!r}, {self._count} bodies)"

    @property
    def name(self) -> str:
        """What results call the set: the name of the file."""
        return self.path.stem

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the bodies, "b00000" and so on."""
        return tuple(_name(number) for number in range(self._count))

    def load(self, name: str) -> Shape:
        """Return one body; its vertex i is the point of vertex i of the built-in humans."""
        if name not in self.names:
            raise DataError(
                f"{self.path}: there is no {name!r}; the names run from {self.names[0]} to {self.names[-1]}"
            )
        humans = load_humans()
        mesh = Mesh(unpack(self._all, self.names.index(name)), humans.faces, name)
        return Shape(mesh, PointMap.identity(mesh.n_vertices, name=name), humans.mirror())

    @cached_property
    def _all(self) -> Arrays:
        return self._arrays(_KEYS)

    def _arrays(self, keys: tuple[str, ...]) -> Arrays:
        try:
            with np.load(self.path, allow_pickle=False) as archive:
                arrays = {key: archive[key] for key in keys}
        except (KeyError, ValueError, OSError, EOFError, zipfile.BadZipFile) as error:
            raise DataError(
                f"{self.path}: wanted a file that `csm bodies` has written, but it cannot be read as one ({error}); "
                "make it again"
            ) from error
        if str(arrays["format"]) != FORMAT:
            raise DataError(f"{self.path}: its format is {arrays['format']}, this version of csm reads {FORMAT!r}")
        return arrays

    def __getstate__(self) -> dict[str, object]:
        return {"path": self.path, "_count": self._count}  # processes read the file themselves
