"""Which method suits two meshes: a network that csm brings where they are what it knows, else the descriptor `acd`.

Whether a network knows shapes shows without ground truth: where its nearest neighbours are right they return to their
place on the way there and back.
"""

from __future__ import annotations

from collections.abc import Sequence

from csm.data.store import Store
from csm.matching.base import Described
from csm.matching.confidence import returning_both_ways
from csm.matching.methods import Method, as_method, describe_all
from csm.matching.parts import KNOWS_PARTS, likely_part
from csm.mesh.shape import Mesh

AUTO = "auto"
"""The name that asks for this choice, in place of a method's."""

KNOWN = 0.8
"""Share of returning nearest neighbours from which a network is taken.

With the network `humans` four pairs of TOSCA's cats, dogs and wolves had 0.60 to 0.67, three pairs of the first 80
shapes of remeshed FAUST 0.99 and more.  With `humans_parts` five cats of which 30 % of the area were cut away had 0.64
or less, and seven bodies of the first 80 of FAUST 0.92 or more.
"""


def suited(meshes: Sequence[Mesh], store: Store, device: str = "cpu") -> tuple[Method, str, list[Described]]:
    """Choose between the network `humans` and the descriptor `acd` for two meshes.

    Where one is open and the other closed, as a part is and its whole (`csm.matching.parts`), it is `humans_parts`, and
    the share is that of the open one: what it lacks cannot return.

    Parameters
    ----------
    meshes
        Two, clean and oriented outwards.
    store
        Where what is computed is kept.
    device
        Where the network runs.

    Returns
    -------
    tuple[Method, str, list[Described]]
        The method, why it was chosen, in words, and the meshes as it describes them, if it is the network.
    """
    part = likely_part(*meshes)
    network = as_method("humans" if part is None else KNOWS_PARTS)
    needed = network.recipe.basis_k if network.recipe else 0
    if min(mesh.n_vertices for mesh in meshes) < needed:
        why = f"model=auto: a mesh has fewer than the {needed} vertices that the network {network.name} needs"
        return as_method("acd"), f"{why}, so the descriptor acd was taken", []
    described = describe_all(network, meshes, store, device)
    shares = returning_both_ways(*described)
    share, whose = (min(shares), "") if part is None else (shares[part], f" of {meshes[part].name or 'the open mesh'}")
    found = f"{100 * share:.0f} % of the nearest neighbours{whose} in the network {network.name} return to their place"
    if share >= KNOWN:
        why = "as on human bodies, so it was taken; model=null is the descriptor acd"
        return network, f"model=auto: {found}, {why}", described
    why = f"fewer than on human bodies, so the descriptor acd was taken; model={network.name} insists"
    if part is None:
        why += f", model={KNOWS_PARTS} where a part is missing"
    return as_method("acd"), f"model=auto: {found}, {why}", []
