"""csm: dense correspondence between deformable meshes with spectral descriptors.

The names below are imported when they are first used, so that ``import csm`` is quick.

Examples
--------
>>> import csm
>>> csm.load_humans().mesh("s00_p00")
Mesh('s00_p00', 6899 vertices, 13794 faces)
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from csm._places import lazily

__version__ = "0.3.0"

if TYPE_CHECKING:
    from csm.data.humans import load_humans
    from csm.data.registry import find_set, recognise
    from csm.data.store import Store
    from csm.descriptors import ACD, HKS, WKS, preset
    from csm.evaluation.engine import evaluate
    from csm.evaluation.protocol import EvaluationProtocol
    from csm.evaluation.results import Evaluation
    from csm.matching import Match, VertexMap, match_features
    from csm.matching import match_meshes as match_meshes
    from csm.matching.collection import MatchedCollection, match_collection
    from csm.matching.match import match
    from csm.matching.network import load_model
    from csm.mesh import Mesh, PointMap, read_mesh, write_mesh
    from csm.mesh.check import check
    from csm.mesh.clean import Cleaned, clean
    from csm.mesh.io import read_polygons
    from csm.mesh.io.textured import read_textured, write_textured
    from csm.operators import Operators
    from csm.operators.geodesic import geodesics

_PLACES = {
    "csm.data.humans": ("load_humans",),
    "csm.data.registry": ("find_set", "recognise"),
    "csm.data.store": ("Store",),
    "csm.descriptors": ("ACD", "HKS", "WKS", "preset"),
    "csm.evaluation.engine": ("evaluate",),
    "csm.evaluation.protocol": ("EvaluationProtocol",),
    "csm.evaluation.results": ("Evaluation",),
    "csm.matching": ("Match", "VertexMap", "match_features", "match_meshes"),
    "csm.matching.collection": ("MatchedCollection", "match_collection"),
    "csm.matching.match": ("match",),
    "csm.matching.network": ("load_model",),
    "csm.mesh": ("Mesh", "PointMap", "read_mesh", "write_mesh"),
    "csm.mesh.check": ("check",),
    "csm.mesh.clean": ("Cleaned", "clean"),
    "csm.mesh.io": ("read_polygons",),
    "csm.mesh.io.textured": ("read_textured", "write_textured"),
    "csm.operators": ("Operators",),
    "csm.operators.geodesic": ("geodesics",),
}

__all__ = [
    "ACD",
    "HKS",
    "WKS",
    "Cleaned",
    "Evaluation",
    "EvaluationProtocol",
    "Match",
    "MatchedCollection",
    "Mesh",
    "Operators",
    "PointMap",
    "Store",
    "VertexMap",
    "check",
    "clean",
    "evaluate",
    "find_set",
    "geodesics",
    "load_humans",
    "load_model",
    "match",
    "match_collection",
    "match_features",
    "preset",
    "read_mesh",
    "read_polygons",
    "read_textured",
    "recognise",
    "write_mesh",
    "write_textured",
]

if not TYPE_CHECKING:
    __getattr__, __dir__ = lazily(__name__, _PLACES)
