"""csm: dense correspondence between deformable meshes with spectral descriptors.

The names below are imported when they are first used, so that ``import csm`` is quick.

Examples
--------
>>> import csm
>>> csm.load_humans().mesh("s00_p00")
Mesh('s00_p00', 6899 vertices, 13794 faces)
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from csm.data.humans import load_humans
    from csm.descriptors import ACD, HKS, WKS
    from csm.evaluation.matching import Match, match_features
    from csm.mesh import Mesh, PointMap, read_mesh, write_mesh
    from csm.mesh.check import check
    from csm.operators import Operators
    from csm.operators.geodesic import geodesics

__all__ = [
    "ACD",
    "HKS",
    "WKS",
    "Match",
    "Mesh",
    "Operators",
    "PointMap",
    "check",
    "geodesics",
    "load_humans",
    "match_features",
    "read_mesh",
    "write_mesh",
]

_HOME = {
    "csm.data.humans": ("load_humans",),
    "csm.descriptors": ("ACD", "HKS", "WKS"),
    "csm.evaluation.matching": ("Match", "match_features"),
    "csm.mesh": ("Mesh", "PointMap", "read_mesh", "write_mesh"),
    "csm.mesh.check": ("check",),
    "csm.operators": ("Operators",),
    "csm.operators.geodesic": ("geodesics",),
}


def __getattr__(name: str) -> Any:
    for module, names in _HOME.items():
        if name in names:
            return getattr(import_module(module), name)
    raise AttributeError(f"module 'csm' has no attribute {name!r}")
