"""Refinement: from the map of a matcher to a better one, by functional maps."""

from csm.matching.refinement.base import Refined, RefinedMap, Refiner
from csm.matching.refinement.registry import REFINERS, refiner

__all__ = ["REFINERS", "Refined", "RefinedMap", "Refiner", "refiner"]
