"""Other triangulations of meshes and of whole sets, kept in the store."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

import numpy as np

from csm._types import Arrays
from csm.data.shapes import Shape, ShapeSet
from csm.data.store import Store
from csm.mesh.correspondence import Direction, PointMap
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


@dataclass(frozen=True, eq=False)
class VariantSet:
    """The shapes of a set with other triangulations, computed once and kept in the store.

    Parameters
    ----------
    base
        The set.
    variant, n_vertices, seed
        As of `remeshed`.
    store_root
        Folder of the store; None for the default one.
    """

    base: ShapeSet
    variant: Variant
    n_vertices: int
    store_root: str | None = None
    seed: int = 0

    @property
    def name(self) -> str:
        """Name of the set, such as "FAUST_6890_remeshed_5000"."""
        return f"{self.base.name}_{self.variant}_{self.n_vertices}"

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the shapes, which are those of the base."""
        return self.base.names

    def load(self, name: str) -> Shape:
        """Return one shape; points of the template that the base does not know stay unknown."""
        original = self.base.load(name)
        made = remeshed(original.mesh, self.variant, self.n_vertices, self.seed, Store(self.store_root))
        mesh = Mesh(made["vertices"], made["faces"], name)

        def carried(known: PointMap) -> PointMap:
            known = known.as_template_to_shape()
            moved = np.where(known.indices >= 0, made["truth"][known.indices], -1)
            return PointMap(moved, Direction.TEMPLATE_TO_SHAPE, mesh.n_vertices, known.name)

        mirror = None if original.mirror is None else carried(original.mirror)
        return replace(original, mesh=mesh, truth=carried(original.truth), mirror=mirror)
