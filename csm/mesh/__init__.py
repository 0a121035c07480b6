"""Triangle meshes: the type, files, correspondences, findings and remeshing."""

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
