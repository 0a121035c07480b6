"""Two described shapes matched in both directions, with how far to believe each way."""

from __future__ import annotations

from dataclasses import dataclass, replace

from csm.matching.base import Described, Matcher
from csm.matching.confidence import confidence_of
from csm.matching.maps import VertexMap
from csm.matching.refinement.base import Refined, start_of
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
        there, back = rule(source, target), rule(target, source)
        return _judged(Way(there), Way(back), None, None, source, target, "")
    starts = start_of(rule.matcher, source, target), start_of(rule.matcher, target, source)
    done = rule.refiner(starts[0], source, target)
    backward = done.backward or rule.refiner(starts[1], target, source).forward
    return _judged(done.forward, backward, *starts, source, target, done.text)


def _judged(
    forward: Way,
    backward: Way,
    first: VertexMap | None,
    second: VertexMap | None,
    source: Described,
    target: Described,
    text: str,
) -> BothWays:
    there, back = forward.vertex_map, backward.vertex_map
    sides, other = Sides(source, target, there, back), Sides(target, source, back, there)
    return BothWays(
        replace(forward, confidence=confidence_of(sides, first)),
        replace(backward, confidence=confidence_of(other, second)),
        text,
    )
