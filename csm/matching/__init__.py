"""From methods to maps: a method describes meshes, a matcher turns two descriptions into a map from shape to shape."""

from typing import TYPE_CHECKING

from csm._places import lazily

if TYPE_CHECKING:
    from csm.matching.barycentric import BarycentricMap, nearest_on_faces
    from csm.matching.base import Described, Matcher
    from csm.matching.maps import VertexMap
    from csm.matching.match import match_features, match_meshes
    from csm.matching.methods import DescriptorMethod, Method, PrecomputedMethod, as_method
    from csm.matching.registry import MATCHERS, matcher
    from csm.matching.result import Match
    from csm.matching.way import Way

__all__ = [
    "MATCHERS",
    "BarycentricMap",
    "Described",
    "DescriptorMethod",
    "Match",
    "Matcher",
    "Method",
    "PrecomputedMethod",
    "VertexMap",
    "Way",
    "as_method",
    "match_features",
    "match_meshes",
    "matcher",
    "nearest_on_faces",
]

_PLACES = {
    "csm.matching.barycentric": ("BarycentricMap", "nearest_on_faces"),
    "csm.matching.base": ("Described", "Matcher"),
    "csm.matching.maps": ("VertexMap",),
    "csm.matching.match": ("match_features", "match_meshes"),
    "csm.matching.methods": ("DescriptorMethod", "Method", "PrecomputedMethod", "as_method"),
    "csm.matching.registry": ("MATCHERS", "matcher"),
    "csm.matching.result": ("Match",),
    "csm.matching.way": ("Way",),
}

if not TYPE_CHECKING:
    __getattr__, __dir__ = lazily(__name__, _PLACES)
