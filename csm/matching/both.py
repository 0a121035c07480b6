"""Two described shapes matched in both directions, with how far to believe each way."""

from __future__ import annotations

from dataclasses import dataclass, replace

from csm._parallel import thread_map
from csm.matching.base import Described, Matcher
from csm.matching.confidence import confidence_of
from csm.matching.maps import VertexMap
from csm.matching.refinement.base import Refined, RefinedMap, start_of
from csm.matching.signals import Sides
from csm.matching.way import Way


@dataclass(frozen=True, eq=False)
class BothWays:
    """The ways source -> target and target -> source, with confidence, and what a refinement did, in words."""

    forward: Way
    backward: Way
    text: str = ""


def match_both_ways(rule: Matcher, source: Described, target: Described) -> BothWays:
    """Match two described shapes in both directions.

    Parameters
    ----------
    rule
        A matcher, or one followed by a refiner (`csm.matching.refinement.Refined`).
    source, target
        The shapes, described by one method.
    """
    if not isinstance(rule, Refined):
        there, back = thread_map(lambda sides: rule(*sides), [(source, target), (target, source)])
        return _judged(RefinedMap(Way(there), Way(back)), Way(back), None, None, source, target)
    start = start_of(rule.matcher, source, target)
    return both_ways_of(rule.refiner(start, source, target), rule, source, target, start)


def both_ways_of(
    done: RefinedMap, rule: Refined, source: Described, target: Described, start: VertexMap | None = None
) -> BothWays:
    """Return the ways of a refined map in both directions, with how far to believe each.

    Parameters
    ----------
    done
        The refined map.
    rule
        By what it was matched and refined; where `done` has no way back, that is made by it.
    source, target
        The shapes.
    start
        What was refined; by default what the matcher of `rule` says.
    """
    first = start or start_of(rule.matcher, source, target)
    second = start_of(rule.matcher, target, source)
    backward = done.backward or rule.refiner(second, target, source).forward
    return _judged(done, backward, first, second, source, target)


def _judged(
    done: RefinedMap,
    backward: Way,
    first: VertexMap | None,
    second: VertexMap | None,
    source: Described,
    target: Described,
) -> BothWays:
    forward = done.forward
    there, back = forward.vertex_map, backward.vertex_map
    sides, other = Sides(source, target, there, back), Sides(target, source, back, there)

    def believed(way: Way, sides: Sides, start: VertexMap | None) -> Way:
        found = confidence_of(sides, start)
        return replace(way, confidence=replace(found, ambiguous=done.ambiguous, strained=done.strained))

    return BothWays(believed(forward, sides, first), believed(backward, other, second), done.text)
