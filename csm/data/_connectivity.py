"""The triangles that the shapes of a set have in common."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable

from csm.errors import CsmError
from csm.mesh.shape import Mesh


def same_connectivity(a: Mesh, b: Mesh) -> bool:
    """Tell whether two meshes have the same triangles of as many vertices."""
    return a.n_vertices == b.n_vertices and a.faces.shape == b.faces.shape and bool((a.faces == b.faces).all())


def shared_mesh(readers: Iterable[Callable[[], Mesh]]) -> Mesh:
    """Return the first mesh whose triangles another one has too, so that one bad file does not blame all others.

    Where no two agree, it is the first that can be read.  Files that cannot are passed over: they are named where they
    are read for themselves.

    Parameters
    ----------
    readers
        One per shape of a set, at least one of which can be read; they are called until two meshes agree.
    """
    seen: dict[tuple[int, bytes], Mesh] = {}
    for read in readers:
        try:
            mesh = read()
        except CsmError:
            continue
        key = mesh.n_vertices, hashlib.blake2b(mesh.faces.tobytes()).digest()
        if key in seen:
            return seen[key]
        seen[key] = mesh
    return next(iter(seen.values()))
