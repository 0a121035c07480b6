"""Refinement: from the map of a matcher to a better one, by functional maps."""

from typing import TYPE_CHECKING

from csm._places import lazily

if TYPE_CHECKING:
    from csm.matching.refinement.base import Refined, RefinedMap, Refiner
    from csm.matching.refinement.registry import REFINERS, refiner

__all__ = ["REFINERS", "Refined", "RefinedMap", "Refiner", "refiner"]

_PLACES = {
    "csm.matching.refinement.base": ("Refined", "RefinedMap", "Refiner"),
    "csm.matching.refinement.registry": ("REFINERS", "refiner"),
}

if not TYPE_CHECKING:
    __getattr__, __dir__ = lazily(__name__, _PLACES)
