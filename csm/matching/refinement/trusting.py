"""Refinement that trusts the start where the descriptor does: `joint` there, `multistart` elsewhere.

A network that knows the shapes gives a map that no search improves, and a search may leave it for a wrong one.  On
shapes that it does not know it exchanges limbs as a descriptor does, and only a search mends that.  Which of the two it
is shows without ground truth: where nearest neighbours are right they return to their place on the way there and back.
In a start that is trusted, those that do so keep their partners, and the refinement finds some for the others
(`csm.matching.refinement.anchors`): it is hardly ever worse than the start.  Only where the vertices of the refined map
return nearer to their place than those of the start, as they do on bodies that the network knows little, it is taken
whole.

A search knows a map by how nearly it keeps areas, lengths and the descriptor.  Where the two bodies differ so much that
even the best map keeps them badly, these say little, and a start of which most returns is the better guess.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import ClassVar

from csm.errors import ConfigError
from csm.matching.base import Described
from csm.matching.confidence import returning
from csm.matching.maps import VertexMap
from csm.matching.refinement.anchors import BothWays, anchored, astray, nearest_both_ways
from csm.matching.refinement.base import RefinedMap, Refiner
from csm.matching.refinement.joint import Joint
from csm.matching.refinement.multistart import Multistart


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
    doubtful, mostly
        A search whose best map has a larger sum of stretch, commutation and distance of the descriptors than `doubtful`
        is not believed where at least the share `mostly` returns: the start is refined as one that is trusted.  See
        docs/lab.md for the pairs that these were chosen on.
    joint, search
        What refines a start that is trusted, and what others.

    Raises
    ------
    ConfigError
        If a share is not between 0 and 1, or `doubtful` is negative.

    Examples
    --------
    >>> Trusting().name
    'trusting'
    """

    returning: float = 0.985
    doubtful: float = 1.1
    mostly: float = 0.8
    joint: Joint = field(default_factory=Joint)
    search: Multistart = field(default_factory=Multistart)

    name: ClassVar[str] = "trusting"

    def __post_init__(self) -> None:
        if not (0 <= self.returning <= 1 and 0 <= self.mostly <= 1 and self.doubtful >= 0):
            raise ConfigError(f"{self}: wanted shares from 0 to 1 for returning and mostly, and doubtful >= 0")

    def __call__(self, start: VertexMap, source: Described, target: Described) -> RefinedMap:
        """Return the refined map."""
        share = returning(source, target)
        said = f"{100 * share:.0f} % of the descriptor's nearest neighbours return near their place, so the start was "
        if share < self.returning:
            found = self.search(start, source, target)
            if found.misfit <= self.doubtful or share < self.mostly:
                return replace(found, text=f"{said}searched for: {found.text}")
            said = (
                f"{said}searched for, but the best of the search keeps areas, lengths and the descriptor badly "
                f"({found.misfit:.2f} in sum), so the start was "
            )
        nearest, done = nearest_both_ways(source, target), self.joint(start, source, target)
        if share >= self.returning and done.backward is not None:
            refined = BothWays(done.forward.vertex_map, done.backward.vertex_map)
            if astray(refined, source, target) < astray(nearest, source, target):
                return replace(done, text=f"{said}refined throughout: {done.text}")
        kept = anchored(done, source, target, nearest)
        return replace(kept, text=f"{said}kept: {kept.text}")
