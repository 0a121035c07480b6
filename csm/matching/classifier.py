"""Matching through the template: by the classifier over its points that a network was trained with."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from csm._types import IntArray
from csm.matching.base import Described, Matcher
from csm.matching.maps import VertexMap


@dataclass(frozen=True)
class Argmax(Matcher):
    """Each vertex goes to its most probable template point, and from there to the vertex that is most probably it."""

    name: ClassVar[str] = "argmax"
    by_classifier: ClassVar[bool] = True

    def __call__(self, source: Described, target: Described, at: IntArray | None = None) -> VertexMap:
        """Return the map through the template; ConfigError if the method has no classifier."""
        indices = target.votes.vertices[source.votes.classes]
        return VertexMap(indices, target.mesh.n_vertices, source.mesh.name, target.mesh.name)
