"""From methods to maps: a method describes meshes, a matcher turns two descriptions into a map from shape to shape."""

from csm.matching.base import Described, Matcher
from csm.matching.maps import VertexMap
from csm.matching.match import Match, match_features, match_meshes
from csm.matching.methods import DescriptorMethod, Method, PrecomputedMethod, as_method
from csm.matching.registry import MATCHERS, matcher

__all__ = [
    "MATCHERS",
    "Described",
    "DescriptorMethod",
    "Match",
    "Matcher",
    "Method",
    "PrecomputedMethod",
    "VertexMap",
    "as_method",
    "match_features",
    "match_meshes",
    "matcher",
]
