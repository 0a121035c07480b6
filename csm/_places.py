"""Objects by the place where they are defined, so that a registry names a class and its file in one line."""

from __future__ import annotations

from importlib import import_module
from operator import attrgetter
from typing import Any


def load(place: str) -> Any:
    """Import an object by its place, such as "csm.descriptors.acd:ACD.paper": a module, a colon, a name in it.

    Examples
    --------
    >>> load("csm.errors:MeshError").__name__
    'MeshError'
    """
    module, _, name = place.partition(":")
    return attrgetter(name)(import_module(module))
