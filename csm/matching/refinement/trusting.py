"""Refinement that trusts the start where the descriptor does: `joint` there, `multistart` elsewhere.

A network that knows the shapes gives a map that no search improves, and a search may leave it for a wrong one.  On
shapes that it does not know it exchanges limbs as a descriptor does, and only a search mends that.  Which of the two it
is shows without ground truth: where nearest neighbours are right they return to their place on the way there and back.
In a start that is trusted, those that do so keep their partners, and the refinement finds some for the others
(`csm.matching.refinement.anchors`): it is hardly ever worse than the start.  Only where the vertices of the refined map
return nearer to their place than those of the start, as they do on bodies that the network knows little, it is taken
whole.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import ClassVar

from csm.errors import ConfigError
from csm.matching.base import Described
from csm.matching.confidence import returning_both_ways
from csm.matching.maps import VertexMap
from csm.matching.parts import likely_part
from csm.matching.refinement.anchors import ThereAndBack, anchored, astray, nearest_both_ways
from csm.matching.refinement.base import RefinedMap, Refiner
from csm.matching.refinement.joint import Joint
from csm.matching.refinement.multistart import Multistart
from csm.matching.way import Way


@dataclass(frozen=True)
class Trusting(Refiner):
    """Refine the start alone where nearest neighbours return there and back, else search for better starts.

    Parameters
    ----------
    returning
        Share of sampled vertices, of either shape, that must return to their place for the start to be trusted.  On 30
        pairs of the first 80 shapes of remeshed FAUST with the network `humans`, the starts with exchanged limbs (more
        than 3 % of the points far off) had 0.974 or less, and of the others all but three had 0.986 or more; at 0.974 a
        search is better by a fifth to a half, at 0.986 it is as good.
    of_part
        The same where one shape is open and the other closed (`csm.matching.parts`), of the open one, which is probably
        a part of the other: what it lacks cannot return, and a search compares shapes as a whole, so such a start is
        kept as it is.  On seven bodies of the first 80 of FAUST without 30 % of their area, with the network
        `humans_parts`, starts erred by 40 thousandths of the diameter and searches by 52; 0.92 or more of the parts'
        vertices returned.  With `humans`, which does not know parts, 0.86 or less did, and a search helped a little.
    joint, search
        What refines a start that is trusted, and what others.

    Raises
    ------
    ConfigError
        If `returning` or `of_part` is not between 0 and 1.

    Examples
    --------
    >>> Trusting().name
    'trusting'
    """

    returning: float = 0.985
    of_part: float = 0.9
    joint: Joint = field(default_factory=Joint)
    search: Multistart = field(default_factory=Multistart)

    name: ClassVar[str] = "trusting"

    def __post_init__(self) -> None:
        if not (0 <= self.returning <= 1 and 0 <= self.of_part <= 1):
            raise ConfigError(f"{self}: wanted shares from 0 to 1 for returning and of_part")

    def __call__(self, start: VertexMap, source: Described, target: Described) -> RefinedMap:
        """Return the refined map."""
        shares, part = returning_both_ways(source, target), likely_part(source.mesh, target.mesh)
        share = min(shares)
        if part is not None and share < self.returning and shares[part] >= self.of_part:
            return self._of_part(shares[part], (source, target)[part], nearest_both_ways(source, target))
        if share < self.returning:
            done, so = self.search(start, source, target), "searched for"
        else:
            done, so = self._of_trusted(start, source, target)
        said = (
            f"{100 * share:.0f} % of the descriptor's nearest neighbours return near their place, so the start was {so}"
        )
        return replace(done, text=f"{said}: {done.text}")

    def _of_part(self, share: float, part: Described, nearest: ThereAndBack) -> RefinedMap:
        """Return nearest neighbours as they are, which is all that can be done with a part."""
        name = part.mesh.name or "the open one"
        text = (
            f"{100 * share:.0f} % of the nearest neighbours of {name}, which is open and probably a part of the other, "
            "return near their place, so they were kept as they are"
        )
        return RefinedMap(Way(nearest.there), Way(nearest.back), text)

    def _of_trusted(self, start: VertexMap, source: Described, target: Described) -> tuple[RefinedMap, str]:
        """Return the refined map of a start that is trusted, and in words what became of the start."""
        nearest, done = nearest_both_ways(source, target), self.joint(start, source, target)
        if done.backward is not None:
            refined = ThereAndBack(done.forward.vertex_map, done.backward.vertex_map)
            if astray(refined, source, target) < astray(nearest, source, target):
                return done, "refined throughout"
        return anchored(done, source, target, nearest), "kept"
