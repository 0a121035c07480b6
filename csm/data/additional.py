"""Shapes that train beside those of the training set: other triangulations of these, or the built-in humans."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import get_args

from csm._places import load
from csm.data.shapes import ShapeSet
from csm.data.store import Store
from csm.data.variants import Variant, VariantSet
from csm.errors import ConfigError


@dataclass(frozen=True, eq=False)
class Additional:
    """Some shapes of a set that a network learns from as well.

    Parameters
    ----------
    shapes, names
        The set, and which of its shapes.
    template
        What the template of the set is called; empty if it is that of the training set, whose classifier they share.
    """

    shapes: ShapeSet
    names: tuple[str, ...]
    template: str = ""

    @property
    def n_classes(self) -> int:
        """Number of template points; the first shape is read."""
        return self.shapes.load(self.names[0]).truth.n_from


def additional(text: str, train_set: ShapeSet, names: Sequence[str], store: Store) -> Additional:
    """Return additional training shapes by a short name.

    Parameters
    ----------
    text
        "remeshed_N" or "refined_N": the training shapes with N vertices and other triangles, or finer; "humans",
        "humans_remeshed_N", "humans_refined_N": the training persons of the built-in humans.
    train_set, names
        The training set, and its shapes that are fitted.
    store
        Where new triangulations are kept.

    Raises
    ------
    ConfigError
        If the name has another form.
    """
    built_in, rest = text.startswith("humans"), text.removeprefix("humans").removeprefix("_")
    variant, _, count = rest.partition("_")
    root = str(store.root)
    if built_in and (not rest or (variant in get_args(Variant) and count.isdigit())):
        shapes: ShapeSet = load("csm.data.humans:HumansSet").parse(rest or "original", root)
        return Additional(shapes, load("csm.data.humans:SPLITS")[0].train, "humans")
    if variant in get_args(Variant) and count.isdigit():
        form: Variant = "refined" if variant == "refined" else "remeshed"
        return Additional(VariantSet(train_set, form, int(count), root), tuple(names))
    raise ConfigError(
        f"data.also: {text!r} is no set that can be added; wanted remeshed_N or refined_N, with N vertices, humans, "
        "humans_remeshed_N or humans_refined_N"
    )
