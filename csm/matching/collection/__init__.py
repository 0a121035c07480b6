"""Sets of shapes: maps between any two of them that agree around cycles."""

from csm.matching.collection.build import match_collection
from csm.matching.collection.result import MatchedCollection

__all__ = ["MatchedCollection", "match_collection"]
