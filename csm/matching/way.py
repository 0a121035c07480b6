"""One way between two shapes: the map in each of the forms in which it is known."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

from csm.matching.barycentric import BarycentricMap
from csm.matching.confidence import Confidence
from csm.matching.functional import FunctionalMap
from csm.matching.maps import VertexMap


@dataclass(frozen=True, eq=False)
class Way:
    """What is known of the map from a source to a target.

    Parameters
    ----------
    vertex_map
        Every vertex of the source to a vertex of the target.
    functional_map
        The map between functions; None if that was not computed.
    confidence
        How far to believe it; None if that was not computed.
    precise
        Computes the map of every vertex of the source into a face of the target; None if that cannot be.
    """

    vertex_map: VertexMap
    functional_map: FunctionalMap | None = None
    confidence: Confidence | None = None
    precise: Callable[[], BarycentricMap] | None = None

    @cached_property
    def barycentric(self) -> BarycentricMap | None:
        """Every vertex of the source into a face of the target, computed when first asked for; None if it cannot be."""
        return None if self.precise is None else self.precise()

    def __repr__(self) -> str:
        more = [name for name in ("functional_map", "confidence", "precise") if getattr(self, name) is not None]
        return f"Way({self.vertex_map.source} -> {self.vertex_map.target}, {', '.join(['vertex_map', *more])})"
