"""Triangle meshes: the type, files, correspondences, findings and remeshing."""

from typing import TYPE_CHECKING

from csm._places import lazily

if TYPE_CHECKING:
    from csm.mesh.correspondence import Direction, GroundTruth, PointMap, ground_truth
    from csm.mesh.inputs import MeshLike, as_mesh
    from csm.mesh.io import read_mesh, read_vts, write_mesh
    from csm.mesh.shape import Mesh

__all__ = [
    "Direction",
    "GroundTruth",
    "Mesh",
    "MeshLike",
    "PointMap",
    "as_mesh",
    "ground_truth",
    "read_mesh",
    "read_vts",
    "write_mesh",
]

_PLACES = {
    "csm.mesh.correspondence": ("Direction", "GroundTruth", "PointMap", "ground_truth"),
    "csm.mesh.inputs": ("MeshLike", "as_mesh"),
    "csm.mesh.io": ("read_mesh", "read_vts", "write_mesh"),
    "csm.mesh.shape": ("Mesh",),
}

if not TYPE_CHECKING:
    __getattr__, __dir__ = lazily(__name__, _PLACES)
