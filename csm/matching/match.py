"""Matching two meshes in one call."""

from __future__ import annotations

import os

import numpy as np

from csm._counts import counted
from csm._types import Float32Array
from csm.data.store import Store
from csm.descriptors.acd import ACD
from csm.descriptors.base import Descriptor
from csm.descriptors.stack import Stack
from csm.matching.base import Described, Matcher, require_device
from csm.matching.both import BothWays, match_both_ways
from csm.matching.confidence import share_returning
from csm.matching.maps import VertexMap
from csm.matching.methods import (
    DescriptorMethod,
    Method,
    PrecomputedMethod,
    as_method,
    describe_all,
    require_classifier,
)
from csm.matching.nearest import nearest
from csm.matching.parts import KNOWS_PARTS, likely_part
from csm.matching.refinement.base import Refined, Refiner
from csm.matching.registry import matchers as as_matchers
from csm.matching.result import Match
from csm.matching.rows import Rows
from csm.matching.signals import SAMPLES
from csm.matching.subjects import Cleaning, Subject, on_given, subject_of
from csm.matching.suited import AUTO, suited
from csm.mesh.debris import body_of
from csm.mesh.inputs import MeshLike


def match(
    source: MeshLike,
    target: MeshLike,
    method: Method | Descriptor | str = "acd",
    matcher: Matcher | str = "nearest",
    refine: Refiner | str | None = "auto",
    *,
    clean: Cleaning = "auto",
    store: Store | str | os.PathLike[str] | None = None,
    device: str = "cpu",
) -> Match:
    """Match two meshes; this is ``csm.match``.

    Parameters
    ----------
    source, target
        Files that `csm.read_mesh` reads, meshes of csm or trimesh, or pairs (vertices, faces) of arrays.
    method
        A descriptor, the name of a preset (the default is csm's own ACD), or a network of `csm.load_model`; "humans",
        a network that csm brings; "auto": this where the shapes look human (`csm.matching.suited`), else csm's own ACD.
    matcher, refine
        A matcher or its name, "nearest" or for networks "argmax", and a refiner or its name
        (`csm.matching.refinement`); "auto": "trusting" for a network, "multistart" for a descriptor; "none".
    clean
        "auto" mends copies of the meshes first (`csm.clean`) where they need it; the result is on the given vertices.
    store
        Where descriptors and bases are kept, or its folder; by default csm's store in the user's cache folder.
    device
        Where features are compared and networks run: "cpu", "cuda", ...

    Returns
    -------
    Match
        Its `indices`, shape (N_source,), hold for each vertex of the source the vertex of the target.

    Raises
    ------
    MeshError, ConfigError
        If a mesh cannot be used; if there is no such method, matcher, refiner or device, or what is given is no mesh.

    Examples
    --------
    >>> import csm
    >>> humans = csm.load_humans()
    >>> csm.match(humans.mesh("s00_p00"), humans.mesh("s00_p02"))  # doctest: +SKIP
    Match(s00_p00 -> s00_p02 by acd, nearest+multistart)
    """
    automatic = isinstance(method, str) and method == AUTO
    chosen, why, known = None if automatic else as_method(method), "", list[Described]()
    require_classifier([chosen] if chosen else [], as_matchers([matcher], ["none" if refine == "auto" else refine]))
    store = store if isinstance(store, Store) else Store(store)
    clean = "off" if isinstance(chosen, PrecomputedMethod) else clean  # its features are of the given vertices
    subjects = subject_of(source, clean, "source"), subject_of(target, clean, "target")
    require_device(device)
    meshes = [subject.cleaned.mesh for subject in subjects]
    if chosen is None:
        chosen, why, known = suited(meshes, store, device)
    (rule,) = as_matchers([matcher], [chosen.refine if refine == "auto" else refine])
    here, there = known or describe_all(chosen, meshes, store, device, embed=isinstance(rule, Refined))
    return match_of(match_both_ways(rule, here, there), subjects, (here, there), chosen, rule, why)


def match_of(
    found: BothWays,
    subjects: tuple[Subject, Subject],
    described: tuple[Described, Described],
    method: Method,
    matcher: Matcher,
    why: str = "",
) -> Match:
    """Return the match of the ways between two cleaned meshes, on the vertices as they were given.

    Its first note is `why` it was made by the method.
    """
    source, target = subjects
    forward, backward = on_given(found.forward, source, target), on_given(found.backward, target, source)
    features = _on_given_rows(described[0], source), _on_given_rows(described[1], target)
    notes = (*filter(None, [why]), *_notes(source, target, method, matcher), *_against_input(*described))
    return Match(source.given, target.given, forward, backward, method, matcher, notes, found.text, features)


_CLEARLY = 0.1  # more of the vertices return

match_meshes = match
"""The name of `match` in the first release."""


def _against_input(here: Described, there: Described) -> list[str]:
    """Say it where the descriptor that a network was given agrees better with itself than the learned one."""
    if here.given is None or there.given is None:
        return []
    tried = here.order[:SAMPLES]
    learned = share_returning(here.mesh, tried, here.rows, there.rows)
    plain = share_returning(here.mesh, tried, here.given, there.given)
    if plain < learned + _CLEARLY:
        return []
    return [
        f"the network may not know such shapes: of its descriptor's nearest neighbours {100 * learned:.0f} % return to "
        f"their place on the way there and back, of those of the descriptor that it was given {100 * plain:.0f} %; "
        "compare it with a match without the network"
    ]


def _on_given_rows(described: Described, subject: Subject) -> Float32Array:
    """Return the features of a cleaned mesh at the given vertices, zero for those that were left out."""
    rows, at = described.values, subject.cleaned.vertex_map
    return np.where(at[:, None] >= 0, rows[at], np.float32(0))


def _notes(source: Subject, target: Subject, method: Method, matcher: Matcher) -> tuple[str, ...]:
    said = [f"{subject.given.label}: {note}" for subject in (source, target) for note in subject.notes]
    if isinstance(method, DescriptorMethod):
        said += _of_descriptor(method.name, method.descriptor, refined=isinstance(matcher, Refined))
    return tuple(dict.fromkeys([*said, *_compared(source, target, method.name)]))


def _of_descriptor(name: str, descriptor: Descriptor, refined: bool) -> list[str]:
    """Say it where the confidence of a descriptor is too high: it was fitted on maps by ACD."""
    if descriptor.turns:
        return [
            f"{name} compares where vertices are in space: its neighbours return to their place even where they are "
            "wrong, so its confidence, which goes by that, is too high"
        ]
    if refined or isinstance(descriptor, ACD | Stack):
        return []
    return [
        f"the confidence of neighbours was fitted on maps by acd; {name} exchanges left and right, or limbs, more "
        "often, and its neighbours return all the same, so its confidence may be far too high"
    ]


def _compared(source: Subject, target: Subject, method: str) -> list[str]:
    """Say what makes two shapes hard to compare: one open and one closed, several components, very few vertices."""
    said = []
    meshes = [subject.cleaned.mesh for subject in (source, target)]
    open_one = likely_part(*meshes)
    if open_one is not None:
        poor = "; spectra of a part differ from those of the whole, so expect a poor map; for human bodies try model="
        said.append(
            f"{meshes[open_one].label} is open, {meshes[1 - open_one].label} is closed, or nearly so: if one is a part "
            "of the other, what is missing has no true partner, and a low confidence"
            + ("" if method == KNOWS_PARTS else poor + KNOWS_PARTS)
        )
    parts = [body_of(mesh).n_components for mesh in meshes]
    if parts[0] != parts[1]:
        said.append(
            f"{meshes[0].label} has {counted(parts[0], 'component')} of at least 1 % of the area, {meshes[1].label} "
            f"{parts[1]}: their spectra are hard to compare; join the components or match them one by one"
        )
    return said


def match_features(
    source: Rows, target: Rows, *, source_name: str = "source", target_name: str = "target"
) -> VertexMap:
    """Map each of N_source rows to the nearest of N_target rows, see `csm.matching.nearest.nearest`.

    Parameters
    ----------
    source, target
        Shapes (N_source, Q) and (N_target, Q): arrays, tensors, or what a descriptor returns.
    source_name, target_name
        Names of the shapes.

    Examples
    --------
    >>> import numpy as np
    >>> match_features(np.array([[0.1], [0.9]]), np.array([[1.0], [0.0]])).indices
    array([1, 0])
    """
    return VertexMap(nearest(source, target), len(target), source_name, target_name)
