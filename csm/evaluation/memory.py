"""A bounded cache of shapes and descriptions, because a shape takes part in many pairs."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Mapping
from typing import Generic, TypeVar

from csm.data.shapes import Shape, ShapeSet
from csm.data.store import Store
from csm.matching.base import Described
from csm.matching.embedded import MOST
from csm.matching.methods import Method

T = TypeVar("T")

_LIMIT = 2**31
_BYTES_PER_EIGENFUNCTION = 12  # and vertex, in both precisions
_BYTES_PER_VERTEX = 300  # of a mesh with its map and what is derived from it


class Recent(Generic[T]):
    """A cache of a function's latest results, bounded by their size; the newest result always stays.

    Parameters
    ----------
    make
        The function, called with names.
    size
        Called with a result: its size in bytes.
    limit
        Bytes that all results may take together.
    """

    def __init__(self, make: Callable[..., T], size: Callable[[T], int], limit: int) -> None:
        self._make, self._size, self._limit = make, size, limit
        self._kept: OrderedDict[tuple[str, ...], T] = OrderedDict()
        self._bytes = 0

    def __call__(self, *names: str) -> T:
        """Return the function's result for these names, from the cache if it is there."""
        if names not in self._kept:
            self._kept[names] = self._make(*names)
            self._bytes += self._size(self._kept[names])
            while self._bytes > self._limit and len(self._kept) > 1:
                self._bytes -= self._size(self._kept.popitem(last=False)[1])
        self._kept.move_to_end(names)
        return self._kept[names]


class Memory:
    """The shapes of a set, and their descriptions by methods.

    Parameters
    ----------
    shapes, methods, store, device
        As in `csm.evaluation.targets.Plan`.
    refined
        Whether maps are refined, for which descriptions also hold eigenfunctions.
    limit
        Bytes of shapes, and bytes of descriptions, that stay in memory.

    Attributes
    ----------
    shape
        Called with the name of a shape; returns it with its map from the template.
    described
        Called with the names of a method and a shape; returns the description.
    """

    def __init__(
        self,
        shapes: ShapeSet,
        methods: Mapping[str, Method],
        store: Store,
        device: str,
        refined: bool = False,
        limit: int = _LIMIT,
    ) -> None:
        def load(name: str) -> Shape:
            shape = shapes.load(name)
            return Shape(shape.mesh, shape.truth.as_template_to_shape(), shape.mirror)

        def describe(method: str, name: str) -> Described:
            return methods[method].describe(self.shape(name).mesh, store, device)

        def size(described: Described) -> int:
            per_vertex = _BYTES_PER_EIGENFUNCTION * MOST if refined else 0
            return described.rows.nbytes + per_vertex * described.mesh.n_vertices

        self.shape = Recent(load, lambda shape: _BYTES_PER_VERTEX * shape.mesh.n_vertices, limit)
        self.described = Recent(describe, size, limit)
