"""Other triangulations of a mesh, kept in the store."""

from __future__ import annotations

from typing import Literal, TypeAlias

from csm._types import Arrays
from csm.data.store import Store
from csm.mesh.remesh import refine, remesh
from csm.mesh.shape import Mesh

Variant: TypeAlias = Literal["refined", "remeshed"]


def remeshed(original: Mesh, variant: Variant, n_vertices: int, seed: int, store: Store) -> Arrays:
    """Return vertices, faces and truth (the vertex of every original one) of another triangulation of a mesh.

    It is computed once and kept in the store.

    Parameters
    ----------
    original
        The mesh.
    variant
        "refined": finer, the original vertices first (as LPS-data does with FAUST); "remeshed": other vertices and
        triangles altogether (as LRVD does).
    n_vertices
        Of the result.
    seed
        Of the remeshing.
    store
        Where it is kept.
    """

    def make() -> Arrays:
        made = (refine if variant == "refined" else remesh)(original, n_vertices, seed)
        return {"vertices": made.mesh.vertices, "faces": made.mesh.faces, "truth": made.truth.indices}

    return store.fetch("remesh", original, {"variant": variant, "n_vertices": n_vertices, "seed": seed}, make)
