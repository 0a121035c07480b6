"""Shapes that train beside those of the training set: other triangulations of these, or the built-in humans."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

from csm._places import load
from csm.data.registry import data_set, find_set
from csm.data.shapes import ShapeSet
from csm.data.store import Store
from csm.data.variants import Variant, VariantSet
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
        "remeshed_N" or "refined_N": the training shapes with N vertices and other triangles, or finer; "humans",
        "humans_remeshed_N", "humans_refined_N": the training persons of the built-in humans; the path of a file that
        ``csm bodies`` has written, "FILE.npz", also with other triangles, "FILE.npz:remeshed_N"; a set beside the
        training set or in the folder `CSM_DATA`, "FAUST_6890" or "SCAPE_5000": the training shapes of its first split.
    train_set, names
        The training set, and its shapes that are fitted.
    store
        Where new triangulations are kept.

    Raises
    ------
    ConfigError
        If the name has another form.
    DataError
        If there is no such file or set.
    """
    template = "" if getattr(train_set, "built_in", False) else _HUMANS
    file, colon, other = text.rpartition(":")
    if not (file.endswith(".npz") and colon and _variant(other)):
        file, other = text, ""
    if file.endswith(".npz"):
        bodies = load("csm.data.bodies.archive:Bodies")(file)
        return Additional(_with_triangles(bodies, other, store), bodies.names, template, bodies.digest)
    if text == "humans" or (text.startswith("humans_") and _variant(text.removeprefix("humans_"))):
        humans = load("csm.data.humans:HumansSet")()
        shapes = _with_triangles(humans, text.removeprefix("humans").removeprefix("_"), store)
        return Additional(shapes, load("csm.data.humans:SPLITS")[0].train, template)
    if _variant(text):
        return Additional(_with_triangles(train_set, text, store), tuple(names))
    for name in _PUBLISHED:
        if text.startswith(f"{name.upper()}_"):
            if train_set.name.upper().startswith(name.upper()):
                raise ConfigError(
                    f"data.also: {text} has the bodies of the training set, {train_set.name}, and test shapes may be "
                    "among them; wanted another set, or remeshed_N or refined_N for the training shapes"
                )
            shapes, split = _found(text, train_set), data_set(name).splits[0]
            split.require(shapes.names, shapes.name, "train")
            return Additional(shapes, split.train, text)
    raise ConfigError(
        f"data.also: {text!r} is no set that can be added; wanted remeshed_N or refined_N, with N vertices, humans, "
        "humans_remeshed_N or humans_refined_N, a file of bodies, FILE.npz, FILE.npz:remeshed_N or FILE.npz:refined_N, "
        "or a set beside the training set or in the folder CSM_DATA, such as FAUST_6890 or SCAPE_5000"
    )


def _found(name: str, train_set: ShapeSet) -> ShapeSet:
    """Return a published set from beside the training set, or from the data folder."""
    root = getattr(train_set, "root", None)
    if root is not None:
        with suppress(DataError):
            return find_set(root.parent, name)
    return find_set(None, name)


def _variant(text: str) -> tuple[Variant, int] | None:
    """Return what "remeshed_5000" or "refined_5000" says, None of another text."""
    form, _, count = text.partition("_")
    if not (count.isascii() and count.isdigit()) or int(count) == 0:
        return None
    return ("refined", int(count)) if form == "refined" else ("remeshed", int(count)) if form == "remeshed" else None


def _with_triangles(shapes: ShapeSet, text: str, store: Store) -> ShapeSet:
    """Return the shapes with the triangles that a text such as "remeshed_5000" names, or their own without a text."""
    found = _variant(text)
    return shapes if found is None else VariantSet(shapes, *found, str(store.root))
