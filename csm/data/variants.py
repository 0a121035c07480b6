"""Other forms of meshes and of whole sets, kept in the store: other triangles, parts cut away, parts grown together."""

from __future__ import annotations

import re
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal, TypeAlias, get_args

import numpy as np

from csm._types import Arrays, IntArray
from csm.data.shapes import Shape, ShapeSet
from csm.data.store import Store
from csm.errors import ConfigError
from csm.mesh.correspondence import Direction, PointMap
from csm.mesh.perturb import Damaged, grown_together, with_slivers, without_part
from csm.mesh.remesh import Remeshed, refine, remesh
from csm.mesh.shape import Mesh

Variant: TypeAlias = Literal["refined", "remeshed", "uneven", "slivers", "cut", "bridged"]

FORMS = (
    "refined_N, remeshed_N or uneven_N with N vertices, slivers_P with P percent more vertices, cut_P with at least P "
    "percent of the area cut away, or bridged_P"
)
"""How the names of variants are written, for messages."""

_PERCENT = ("slivers", "cut", "bridged")

_BY_NAME = ("uneven", "cut")
"""Forms whose draws differ between the shapes of one set."""

_CONTRAST = 4.0
"""How many times longer the edges of "uneven" are at one end of the shape than at the other."""


@dataclass(frozen=True)
class Variation:
    """One way to change every mesh of a set.

    Parameters
    ----------
    variant
        "refined": finer, the original vertices first (as LPS-data does with FAUST); "remeshed": other vertices and
        triangles altogether (as LRVD does); "uneven": the same, with edges four times as long at one end of the shape
        as at the other, along a drawn direction; "slivers": the original vertices first, and new ones that split drawn
        edges close to an end, which makes thin triangles; "cut": a part around a drawn vertex is cut away, and of what
        is left the largest piece stays, so that more may be gone; "bridged": a tube joins the places that are nearest
        in space among those that are far apart along the surface, as where limbs of a scan touch.
    amount
        The number of vertices, of "refined", "remeshed" and "uneven"; how many percent more vertices "slivers" has; how
        many percent of the area are cut away; how long the way along the surface is at least that a bridge shortens, in
        percent of the root of the area.
    seed
        Of the draws.
    """

    variant: Variant
    amount: int
    seed: int = 0

    def __post_init__(self) -> None:
        if self.amount < 1 or (self.variant in _PERCENT and self.amount > 99):
            wanted = "1 to 99 percent" if self.variant in _PERCENT else "1 vertex or more"
            raise ConfigError(f"{self.variant}_{self.amount}: wanted {wanted}")

    @classmethod
    def parse(cls, text: str) -> Variation | None:
        """Return what a name such as "remeshed_5000" says; None if it is not of this form.

        Raises
        ------
        ConfigError
            If it is, with a number that cannot be.

        Examples
        --------
        >>> Variation.parse("cut_30")
        Variation(variant='cut', amount=30, seed=0)
        >>> Variation.parse("humans") is None
        True
        """
        variant, _, amount = text.partition("_")
        if variant not in get_args(Variant) or not re.fullmatch(r"0|[1-9][0-9]{0,8}", amount):
            return None
        return cls(variant, int(amount))  # type: ignore[arg-type]

    def __str__(self) -> str:
        return f"{self.variant}_{self.amount}"

    def of(self, original: Mesh, store: Store) -> Arrays:
        """Return vertices, faces and truth (the vertex of every original one, -1 where it is gone) of the changed mesh.

        It is computed once and kept in the store.  What is cut away, and where a mesh is uneven, depends on the name of
        the mesh, so that shapes of one set lose different parts.

        Raises
        ------
        csm.errors.MeshError
            If the mesh cannot be changed so.
        """
        seed = self.seed + (zlib.crc32(original.name.encode()) if self.variant in _BY_NAME else 0)
        amount = {"percent" if self.variant in _PERCENT else "n_vertices": self.amount}
        params = {"variant": self.variant, **amount, "seed": seed}
        return store.fetch("remesh", original, params, lambda: _MAKERS[self.variant](original, self.amount, seed))


_Maker: TypeAlias = Callable[[Mesh, int, int], Arrays]


def _remade(make: Callable[[Mesh, int, int], Remeshed]) -> _Maker:
    def maker(original: Mesh, n_vertices: int, seed: int) -> Arrays:
        made = make(original, n_vertices, seed)
        return _arrays(made.mesh, made.truth.indices)

    return maker


def _slivers(original: Mesh, percent: int, seed: int) -> Arrays:
    return _damaged(original, with_slivers(original, percent / 100, seed))


def _cut(original: Mesh, percent: int, seed: int) -> Arrays:
    centre = int(np.random.default_rng(seed).integers(original.n_vertices))
    return _damaged(original, without_part(original, centre, percent / 100))


def _bridged(original: Mesh, percent: int, seed: int) -> Arrays:
    return _damaged(original, grown_together(original, percent / 100))


_MAKERS: Mapping[Variant, _Maker] = {
    "refined": _remade(refine),
    "remeshed": _remade(remesh),
    "uneven": _remade(partial(remesh, contrast=_CONTRAST)),
    "slivers": _slivers,
    "cut": _cut,
    "bridged": _bridged,
}


def _damaged(original: Mesh, made: Damaged) -> Arrays:
    truth, old = np.full(original.n_vertices, -1), np.flatnonzero(made.kept >= 0)
    truth[made.kept[old[::-1]]] = old[::-1]  # of a vertex that was split, the first stands for it
    return _arrays(made.mesh, truth)


def _arrays(mesh: Mesh, truth: IntArray) -> Arrays:
    return {"vertices": mesh.vertices, "faces": mesh.faces, "truth": truth}


@dataclass(frozen=True, eq=False)
class VariantSet:
    """The shapes of a set in another form, computed once and kept in the store.

    Parameters
    ----------
    base
        The set.
    variation
        What is changed.
    store_root
        Folder of the store; None for the default one.
    """

    base: ShapeSet
    variation: Variation
    store_root: str | None = None

    @property
    def name(self) -> str:
        """Name of the set, such as "FAUST_6890_remeshed_5000"."""
        return f"{self.base.name}_{self.variation}"

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the shapes, which are those of the base."""
        return self.base.names

    @property
    def built_in(self) -> bool:
        """Whether the shapes come with csm."""
        return bool(getattr(self.base, "built_in", False))

    def load(self, name: str) -> Shape:
        """Return one shape; points of the template that the base does not know, or that are cut away, are unknown."""
        original = self.base.load(name)
        made = self.variation.of(original.mesh, Store(self.store_root))
        mesh = Mesh(made["vertices"], made["faces"], name)

        def carried(known: PointMap) -> PointMap:
            known = known.as_template_to_shape()
            moved = np.where(known.indices >= 0, made["truth"][known.indices], -1)
            return PointMap(moved, Direction.TEMPLATE_TO_SHAPE, mesh.n_vertices, known.name)

        mirror = None if original.mirror is None else carried(original.mirror)
        return replace(original, mesh=mesh, truth=carried(original.truth), mirror=mirror)


def in_form(shapes: ShapeSet, text: str, store: Store, option: str) -> VariantSet:
    """Return the shapes of a set in the form that a text such as "remeshed_5000" names.

    Parameters
    ----------
    shapes
        The set.
    text
        What `Variation.parse` reads.
    store
        Where the form is kept.
    option
        Which option the text was given to, for the message.

    Raises
    ------
    ConfigError
        If the text has another form.
    """
    if (variation := Variation.parse(str(text))) is None:
        raise ConfigError(f"{option}: {text!r} is no form of a set; wanted {FORMS}")
    return VariantSet(shapes, variation, str(store.root))
