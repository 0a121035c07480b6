"""The base class of the refiners, and a matcher followed by one."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import asdict, dataclass
from typing import Any, ClassVar

from csm._types import IntArray
from csm.matching.base import Described, Matcher
from csm.matching.maps import VertexMap
from csm.matching.signals import SAMPLES
from csm.matching.way import Way


@dataclass(frozen=True, eq=False)
class RefinedMap:
    """What a refiner makes of a start.

    Parameters
    ----------
    forward
        The way source -> target.
    backward
        The way target -> source that belongs to it; None if the refiner makes none.
    text
        What was done, in words, with its figures.
    ambiguous
        Whether another map was found that is about as good: the shapes look the same in several ways.
    strained
        Whether even the best map that was found keeps areas, lengths and the descriptor badly.
    """

    forward: Way
    backward: Way | None = None
    text: str = ""
    ambiguous: bool = False
    strained: bool = False


class Refiner(ABC):
    """A rule that makes a better map of one; its fields are its parameters.

    A refiner is a frozen dataclass.  It is added to csm by one file here and one line in
    `csm.matching.refinement.registry`.
    """

    name: ClassVar[str]

    @abstractmethod
    def __call__(self, start: VertexMap, source: Described, target: Described) -> RefinedMap:
        """Refine a map source -> target; -1 where no partner is known, such as at all but some samples."""

    def parameters(self) -> dict[str, Any]:
        """Return every parameter as plain data: with `name`, all that a cache key needs."""
        return asdict(self)  # type: ignore[call-overload,no-any-return]


def start_of(matcher: Matcher, source: Described, target: Described) -> VertexMap:
    """Return the map of a matcher at samples of the source, which is enough to begin a refinement with."""
    return matcher(source, target, at=source.order[:SAMPLES])


@dataclass(frozen=True)
class Refined(Matcher):
    """A matcher followed by a refiner: a matcher again, named after both.

    Examples
    --------
    >>> from csm.matching import matcher
    >>> from csm.matching.refinement import refiner
    >>> Refined(matcher("nearest"), refiner("joint")).name
    'nearest+joint'
    """

    matcher: Matcher
    refiner: Refiner

    @property
    def name(self) -> str:  # type: ignore[override]
        """Names of both, with a plus sign between them."""
        return f"{self.matcher.name}+{self.refiner.name}"

    @property
    def by_classifier(self) -> bool:  # type: ignore[override]
        """Whether its matcher needs a classifier."""
        return self.matcher.by_classifier

    def __call__(self, source: Described, target: Described, at: IntArray | None = None) -> VertexMap:
        """Return the refined map, of all vertices whatever is asked for: a refinement needs all of them."""
        return self.refiner(start_of(self.matcher, source, target), source, target).forward.vertex_map

    def parameters(self) -> dict[str, Any]:
        """Return the parameters of both."""
        return {**self.matcher.parameters(), "refiner": {"name": self.refiner.name, **self.refiner.parameters()}}
