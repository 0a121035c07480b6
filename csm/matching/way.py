"""One way between two shapes: the map in each of the forms in which it is known."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from csm.matching.barycentric import BarycentricMap
from csm.matching.maps import VertexMap


@dataclass(frozen=True, eq=False)
class Way:
    """What is known of the map from a source to a target.

    Parameters
    ----------
    vertex_map
        Every vertex of the source to a vertex of the target.
    barycentric
        Every vertex of the source into a face of the target; None if that was not computed.
    functional_map
        The map between functions; None if that was not computed.
    """

    vertex_map: VertexMap
    barycentric: BarycentricMap | None = None
    functional_map: Any = None

    def __repr__(self) -> str:
        more = [name for name in ("barycentric", "functional_map") if getattr(self, name) is not None]
        return f"Way({self.vertex_map.source} -> {self.vertex_map.target}, {', '.join(['vertex_map', *more])})"
