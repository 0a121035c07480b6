"""Other triangulations of a shape, finer or independent, with exact ground truth."""

from csm.mesh.remesh.remesher import Remeshed, refine, remesh

__all__ = ["Remeshed", "refine", "remesh"]
