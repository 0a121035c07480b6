"""Objects by the place where they are defined, imported when they are first used.

A registry so names a class and its file in one line, and a package offers what its modules define without importing
them: what is not used costs no time, and the names of a registry can be listed before anything in it is loaded.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, MutableMapping, Sequence
from importlib import import_module
from operator import attrgetter
from typing import Any, TypeVar

T = TypeVar("T")


def shown(name: object) -> str:
    """Return a name as a message shows it, or what came instead of one.

    Examples
    --------
    >>> shown("hks"), shown([1, 2])
    ("'hks'", 'a list')
    """
    return repr(name) if isinstance(name, str) else f"a {type(name).__name__}"


def load(place: str) -> Any:
    """Import an object by its place, such as "csm.descriptors.acd:ACD.paper": a module, a colon, a name in it.

    Examples
    --------
    >>> load("csm.errors:MeshError").__name__
    'MeshError'
    """
    module, _, name = place.partition(":")
    return attrgetter(name)(import_module(module))


class Loaded(MutableMapping[str, T]):
    """A registry whose objects are made when they are first asked for; its names are known before.

    Parameters
    ----------
    makers
        Name -> what makes the object.

    Examples
    --------
    >>> found = Loaded({"mesh": lambda: load("csm.errors:MeshError"), "none": lambda: load("csm.nowhere:Nothing")})
    >>> list(found), found["mesh"].__name__
    (['mesh', 'none'], 'MeshError')
    """

    def __init__(self, makers: Mapping[str, Callable[[], T]]) -> None:
        self._makers, self._made = dict(makers), dict[str, T]()

    def __getitem__(self, name: str) -> T:
        if name not in self._made:
            self._made[name] = self._makers[name]()
        return self._made[name]

    def __setitem__(self, name: str, value: T) -> None:
        self._makers[name] = lambda: value
        self._made[name] = value

    def __delitem__(self, name: str) -> None:
        del self._makers[name]
        self._made.pop(name, None)

    def __contains__(self, name: object) -> bool:  # without making it, as Mapping would
        return name in self._makers

    def __iter__(self) -> Iterator[str]:
        return iter(self._makers)

    def __len__(self) -> int:
        return len(self._makers)

    def __repr__(self) -> str:
        return f"Loaded({', '.join(self)})"


def lazily(package: str, places: Mapping[str, Sequence[str]]) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Return ``__getattr__`` and ``__dir__`` of a package whose names are imported when they are first used.

    What is listed is its ``__all__``.

    Parameters
    ----------
    package
        Its name.
    places
        Module -> the names in it that the package offers.

    Examples
    --------
    >>> find, names = lazily("csm.mesh", {"csm.errors": ("MeshError", "DataError")})
    >>> find("MeshError").__name__, "read_mesh" in names()
    ('MeshError', True)
    """
    where = {name: module for module, names in places.items() for name in names}

    def find(name: str) -> Any:
        if name not in where:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return load(f"{where[name]}:{name}")

    def names() -> list[str]:
        own = vars(import_module(package))
        return sorted({*(name for name in own if name.startswith("__")), *own["__all__"]})

    return find, names
