"""Which of two shapes is probably a part of the other."""

from __future__ import annotations

import numpy as np

from csm.mesh.shape import Mesh
from csm.mesh.topology import rim

KNOWS_PARTS = "humans_parts"
"""The network that csm brings for human bodies of which a part may be missing."""

_OPEN, _CLOSED = 0.3, 0.1  # lengths of the boundary over the root of the area


def likely_part(source: Mesh, target: Mesh) -> int | None:
    """Return 0 if the source is open and the target closed, as a part of it is, 1 the other way round, else None.

    Open: the boundary is longer than 0.3 of the root of the area; closed: shorter than 0.1 of it.
    """
    rims = [rim(mesh.vertices, mesh.faces) / float(np.sqrt(mesh.area)) for mesh in (source, target)]
    part = int(rims[1] > rims[0])
    return part if rims[part] > _OPEN and rims[1 - part] < _CLOSED else None
