"""A file of made bodies, and the set of shapes that it is."""

from __future__ import annotations

import os
from functools import cached_property, lru_cache, partial
from pathlib import Path

import numpy as np

from csm import __version__
from csm._parallel import parallel_map
from csm._places import load
from csm._signals import saying
from csm._types import Arrays, FloatArray
from csm.data.humans import load_humans
from csm.data.packed import pack, unpack
from csm.data.shapes import Shape
from csm.errors import ConfigError, DataError
from csm.mesh.correspondence import PointMap
from csm.mesh.io import atomic_path, file_digest
from csm.mesh.shape import Mesh

FORMAT = "csm bodies 1"
_KEYS = ("format", "differences", "offset", "step", "seed", "versions")


def make_bodies(
    path: str | os.PathLike[str],
    count: int,
    seed: int = 0,
    workers: int = 0,
    progress: bool = True,
    *,
    overwrite: bool = False,
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
    overwrite
        Whether a file that is there may be replaced.

    Raises
    ------
    ConfigError
        If `anny` is not installed, an argument is out of its range, or there is such a file.

    Examples
    --------
    >>> make_bodies("bodies.npz", 1000)  # doctest: +SKIP
    Bodies('bodies.npz', 1000 bodies)
    """
    _require(path, count, seed, overwrite)
    load("csm.data.bodies.making:require_anny")()
    with saying(lambda: "nothing is kept of the bodies; the same command begins again"):
        shapes = parallel_map(
            partial(_made, seed), range(count), _name, workers, what="bodies", unit="body", progress=progress
        )
    _require(path, count, seed, overwrite)  # it took a while: another may have written there
    arrays = pack(np.stack(shapes)) | {
        "format": np.array(FORMAT),
        "seed": np.array(seed),
        "versions": np.array([f"csm {__version__}", *load("csm.data.bodies.making:versions")()]),
    }
    with atomic_path(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **arrays)  # type: ignore[arg-type]
    return Bodies(path)


def _require(path: str | os.PathLike[str], count: int, seed: int, overwrite: bool) -> None:
    if not os.fspath(path).endswith(".npz"):
        raise ConfigError(f"{os.fspath(path)}: wanted the name of a file that ends with .npz")
    for what, value, least in (("count", count, 1), ("seed", seed, 0)):
        if isinstance(value, bool) or not isinstance(value, int) or value < least:
            raise ConfigError(f"{what}={value!r}: wanted a whole number from {least}")
    if os.path.lexists(path) and not overwrite:
        raise ConfigError(f"{os.fspath(path)}: is there already; overwrite=true replaces it")


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
        self.path = Path(path).expanduser()
        if self.path.is_dir():
            raise DataError(f"{self.path}: this is a folder, wanted a file that `csm bodies` has written")
        if not self.path.is_file():
            raise DataError(f"{self.path}: there is no such file; `csm bodies` makes one")
        step = self._arrays(("format", "step"))["step"]
        if step.ndim != 1 or len(step) == 0 or not np.isfinite(step).all():
            raise self._odd("it holds no bodies")
        self._count = len(step)

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
    def digest(self) -> str:
        """Hash of the content, which tells files of one name apart."""
        return file_digest(self.path)[:12]

    @cached_property
    def _all(self) -> Arrays:
        arrays = self._arrays(_KEYS)
        n = load_humans().n_vertices
        shapes = {"differences": (self._count, n, 3), "offset": (self._count, 3), "step": (self._count,)}
        if any(arrays[key].shape != shape for key, shape in shapes.items()) or not np.isfinite(arrays["offset"]).all():
            raise self._odd(f"its arrays are not those of {self._count} bodies of {n} vertices")
        return arrays

    def _arrays(self, keys: tuple[str, ...]) -> Arrays:
        try:
            with np.load(self.path, allow_pickle=False) as archive:
                arrays = {key: archive[key] for key in keys}
        except Exception as error:  # a damaged archive makes its reader raise whatever it trips over
            raise self._odd(str(error) or type(error).__name__) from error
        if str(arrays["format"]) != FORMAT:
            raise DataError(f"{self.path}: its format is {arrays['format']}, this version of csm reads {FORMAT!r}")
        return arrays

    def _odd(self, why: str) -> DataError:
        return DataError(f"{self.path}: wanted a file that `csm bodies` has written, but {why}; make it again")

    def __getstate__(self) -> dict[str, object]:
        return {"path": self.path, "_count": self._count}  # processes read the file themselves
