"""The built-in humans as sets of shapes: as they are, refined, or remeshed, always with exact ground truth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias, get_args

from csm._types import Arrays
from csm.data.humans import load_humans
from csm.data.shapeset import Shape
from csm.data.store import Store
from csm.errors import ConfigError
from csm.mesh.correspondence import Direction, PointMap
from csm.mesh.remesh import refine, remesh
from csm.mesh.shape import Mesh

Variant: TypeAlias = Literal["original", "refined", "remeshed"]


@dataclass(frozen=True)
class HumansSet:
    """The built-in humans over the template of their common connectivity.

    Parameters
    ----------
    variant
        "original": the shipped meshes; "refined": finer, the original vertices first (as LPS-data does with FAUST);
        "remeshed": other vertices and triangles altogether (as LRVD does).
    n_vertices
        Of the refined or remeshed meshes; 0 for the original ones.
    store_root
        Folder of the store that keeps refined and remeshed meshes; None for the default one.
    seed
        Of the remeshing.
    """

    variant: Variant = "original"
    n_vertices: int = 0
    store_root: str | None = None
    seed: int = 0

    @classmethod
    def parse(cls, text: str, store_root: str | None = None) -> HumansSet:
        """Make a set from its short name: "original", "refined_10000", "remeshed_5000".

        Raises
        ------
        ConfigError
            If the name has another form.

        Examples
        --------
        >>> HumansSet.parse("refined_10000").name
        'humans_refined_10000'
        """
        variant, _, count = text.partition("_")
        if variant not in get_args(Variant) or (variant == "original") != (count == "") or not (count or "0").isdigit():
            raise ConfigError(f"built-in humans: {text!r} is no set; wanted original, refined_N or remeshed_N")
        return cls(variant, int(count or 0), store_root)  # type: ignore[arg-type]

    @property
    def name(self) -> str:
        """Name of the set in results."""
        return "humans" if self.variant == "original" else f"humans_{self.variant}_{self.n_vertices}"

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the shapes, person by person: "s00_p00" to "s09_p09"."""
        return load_humans().names

    def load(self, name: str) -> Shape:
        """Return one shape; a refined or remeshed one is made once and kept in the store."""
        humans = load_humans()
        original, flip = humans.mesh(name), humans.mirror().indices
        if self.variant == "original":
            return Shape(original, PointMap.identity(original.n_vertices, name=name), humans.mirror())
        made = remeshed(original, self.variant, self.n_vertices, self.seed, Store(self.store_root))
        mesh = Mesh(made["vertices"], made["faces"], name)
        truth = PointMap(made["truth"], Direction.TEMPLATE_TO_SHAPE, mesh.n_vertices, name)
        mirror = PointMap(made["truth"][flip], Direction.TEMPLATE_TO_SHAPE, mesh.n_vertices, f"{name}, mirrored")
        return Shape(mesh, truth, mirror)


def remeshed(original: Mesh, variant: str, n_vertices: int, seed: int, store: Store) -> Arrays:
    """Return vertices, faces and truth (the vertex of every original one) of a "refined" or "remeshed" mesh.

    It is made once and kept in the store.
    """

    def make() -> Arrays:
        made = (refine if variant == "refined" else remesh)(original, n_vertices, seed)
        return {"vertices": made.mesh.vertices, "faces": made.mesh.faces, "truth": made.truth.indices}

    return store.fetch("remesh", original, {"variant": variant, "n_vertices": n_vertices, "seed": seed}, make)
