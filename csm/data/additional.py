"""Shapes that train beside those of the training set: other forms of these, the built-in humans, or other sets."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

from csm._places import load
from csm.data.registry import data_set, find_set
from csm.data.shapes import ShapeSet
from csm.data.store import Store
from csm.data.variants import FORMS, Variation, in_form
from csm.errors import ConfigError, DataError

_PUBLISHED = ("faust", "scape")
"""Data sets whose shapes can be added: those that have a split."""

_HUMANS = "humans"  # the template of the built-in humans and of bodies


@dataclass(frozen=True, eq=False)
class Additional:
    """Some shapes of a set that a network learns from as well.

    Parameters
    ----------
    shapes, names
        The set, and which of its shapes.
    template
        What the template of the set is called; empty if it is that of the training set, whose classifier they share.
    digest
        Hash of the file that they come from, where they come from one.
    """

    shapes: ShapeSet
    names: tuple[str, ...]
    template: str = ""
    digest: str = ""

    @property
    def label(self) -> str:
        """What tells these shapes from others, for records."""
        return f"{self.shapes.name} ({self.digest})" if self.digest else self.shapes.name

    @property
    def n_classes(self) -> int:
        """Number of template points; the first shape is read."""
        return self.shapes.load(self.names[0]).truth.n_from


def additional(text: str, train_set: ShapeSet, names: Sequence[str], store: Store) -> Additional:
    """Return additional training shapes by a short name.

    Parameters
    ----------
    text
        A form (`csm.data.variants.Variation`) such as "remeshed_5000" or "cut_30": the training shapes in it; "humans",
        "humans_FORM": the training persons of the built-in humans; the path of a file that ``csm bodies`` has written,
        "FILE.npz", also in another form, "FILE.npz:FORM"; a set beside the training set or in the folder `CSM_DATA`,
        "FAUST_6890" or "SCAPE_5000": the training shapes of its first split.
    train_set, names
        The training set, and its shapes that are fitted.
    store
        Where other forms are kept.

    Raises
    ------
    ConfigError
        If the name has another form.
    DataError
        If there is no such file or set.
    """
    template = "" if getattr(train_set, "built_in", False) else _HUMANS
    file, colon, other = text.rpartition(":")
    if not (file.endswith(".npz") and colon and Variation.parse(other)):
        file, other = text, ""
    if file.endswith(".npz"):
        bodies = load("csm.data.bodies.archive:Bodies")(file)
        shapes = in_form(bodies, other, store, "data.also") if other else bodies
        return Additional(shapes, bodies.names, template, bodies.digest)
    if text == "humans" or (text.startswith("humans_") and Variation.parse(text.removeprefix("humans_"))):
        humans = load("csm.data.humans:HumansSet")()
        form = text.removeprefix("humans").removeprefix("_")
        shapes = in_form(humans, form, store, "data.also") if form else humans
        return Additional(shapes, load("csm.data.humans:SPLITS")[0].train, template)
    if Variation.parse(text):
        return Additional(in_form(train_set, text, store, "data.also"), tuple(names))
    for name in _PUBLISHED:
        if text.startswith(f"{name.upper()}_"):
            if train_set.name.upper().startswith(name.upper()):
                raise ConfigError(
                    f"data.also: {text} has the bodies of the training set, {train_set.name}, and test shapes may be "
                    "among them; wanted another set, or a form of the training shapes, such as remeshed_5000"
                )
            shapes, split = _found(text, train_set), data_set(name).splits[0]
            split.require(shapes.names, shapes.name, "train")
            return Additional(shapes, split.train, text)
    raise ConfigError(
        f"data.also: {text!r} is no set that can be added; wanted a FORM ({FORMS}), humans, humans_FORM, a file of "
        "bodies, FILE.npz or FILE.npz:FORM, or a set beside the training set or in the folder CSM_DATA, such as "
        "FAUST_6890 or SCAPE_5000"
    )


def _found(name: str, train_set: ShapeSet) -> ShapeSet:
    """Return a published set from beside the training set, or from the data folder."""
    root = getattr(train_set, "root", None)
    if root is not None:
        with suppress(DataError):
            return find_set(root.parent, name)
    return find_set(None, name)
