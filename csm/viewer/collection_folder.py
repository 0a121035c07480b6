"""What a matched collection leaves in a folder: maps, shapes in the reference's colours, a page, an account."""

from __future__ import annotations

import os
import re
import tempfile
from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import permutations
from pathlib import Path
from typing import Any, Literal, TypeAlias, get_args

import numpy as np

from csm._counts import counted
from csm._types import IntArray
from csm.errors import ConfigError
from csm.evaluation.provenance import provenance
from csm.matching.collection import MatchedCollection
from csm.matching.methods import DescriptorMethod
from csm.mesh.io import write_map, write_mesh
from csm.mesh.io.guard import refusals
from csm.mesh.io.owned import COLLECTION, files_of, put_in_place, remove_left, require_not_input, require_own
from csm.viewer.colors import position_colors, pull_colors
from csm.viewer.html import Panel, Viewer, viewer_html, write_html

ACCOUNT = COLLECTION
"""How the collection was matched; it has the hashes of the other files."""

PAGE, REFERENCE = "collection.html", "reference.ply"

ALL_UP_TO = 20
"""Number of shapes up to which the maps of all pairs are written unless something else is asked for."""

Pairs: TypeAlias = Literal["auto", "all", "reference"]
"""Which maps are written: of all ordered pairs, or to and from the reference; "auto" decides by their number."""

_SHOWN = 12  # shapes in the page
_OWN = re.compile(r"maps/[^/]+_to_[^/]+\.txt|shapes/[^/]+\.ply")


def require_pairs(pairs: str) -> None:
    """Raise a ConfigError if there is no such choice of pairs."""
    if pairs not in get_args(Pairs):
        raise ConfigError(f"pairs={pairs}: wanted {', '.join(get_args(Pairs)[:-1])} or {get_args(Pairs)[-1]}")


def places(names: Sequence[str]) -> list[str]:
    """Return every file, relative to the folder, that a collection of these names may leave besides its account.

    Raises
    ------
    ConfigError
        If two of the files would have one name.

    Examples
    --------
    >>> places(["a", "b"])
    ['collection.html', 'reference.ply', 'shapes/a.ply', 'shapes/b.ply', 'maps/a_to_b.txt', 'maps/b_to_a.txt']
    """
    files = [f"shapes/{_plain(name)}.ply" for name in names]
    files += [_map_file(a, b) for a, b in permutations(names, 2)]
    twice = [file for file, times in Counter(files).items() if times > 1]
    if twice:
        raise ConfigError(f"{twice[0]} would be the file of two shapes or two pairs; give the meshes other names")
    return [PAGE, REFERENCE, *files]


def save_collection(
    collection: MatchedCollection, folder: str | os.PathLike[str], *, pairs: str = "auto", overwrite: bool = False
) -> Path:
    """Write a collection to a folder, see `csm.matching.collection.MatchedCollection.save`, and return the folder.

    Raises
    ------
    DataError
        If a file of such a name is there that csm did not write, or the folder cannot be written.
    """
    folder = Path(folder)
    require_pairs(pairs)
    files = [folder / name for name in places(collection.names)]
    require_not_input([*files, folder / ACCOUNT], [Path(mesh.source) for mesh in collection.meshes if mesh.source])
    require_own(files, folder / ACCOUNT, overwrite)
    write_collection(collection, folder, pairs=pairs)
    return folder


def write_collection(
    collection: MatchedCollection,
    folder: Path,
    *,
    pairs: str = "auto",
    seconds: float | None = None,
    workers: int | None = None,
    progress: bool = True,
) -> int:
    """Write maps, shapes, page and account; what an earlier run wrote and this one does not is removed.

    Parameters
    ----------
    collection
        What to write.
    folder
        Where it goes; it is made if needed.
    pairs
        See `Pairs`.
    seconds
        How long the matching took, if that is known.
    workers, progress
        As of `csm.matching.collection.MatchedCollection.vertex_maps`.

    Returns
    -------
    int
        How many maps were written.
    """
    wanted = chosen_pairs(len(collection.names), collection.reference_index, pairs)
    maps = collection.vertex_maps(wanted, workers=workers, progress=progress)
    indices = {pair: found.indices for pair, found in zip(wanted, maps, strict=True)}
    with refusals(folder, "written"):
        folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=".csm-", dir=folder) as staged:
        files = _write_files(collection, indices, Path(staged))
        took = {} if seconds is None else {"seconds": round(seconds, 2)}
        earlier = files_of(folder / ACCOUNT)
        put_in_place(Path(staged), files, folder / ACCOUNT, {**_account(collection, len(wanted)), **took})
        gone = {name: known for name, known in earlier.items() if name not in files and _OWN.fullmatch(name)}
        remove_left(folder / ACCOUNT, gone)
    return len(wanted)


def chosen_pairs(n: int, reference: int, pairs: str) -> list[tuple[int, int]]:
    """Return the pairs whose maps are written.

    Examples
    --------
    >>> chosen_pairs(3, 1, "reference")
    [(0, 1), (1, 0), (1, 2), (2, 1)]
    """
    every = permutations(range(n), 2)
    if pairs == "all" or (pairs == "auto" and n <= ALL_UP_TO):
        return list(every)
    return [pair for pair in every if reference in pair]


def _write_files(collection: MatchedCollection, indices: Mapping[tuple[int, int], IntArray], folder: Path) -> list[str]:
    """Write all files but the account; return their names relative to the folder."""
    names, meshes, middle = collection.names, collection.meshes, collection.reference_index
    reference = position_colors(meshes[middle])
    (folder / "maps").mkdir()
    (folder / "shapes").mkdir()
    files = [PAGE, REFERENCE]
    for (i, j), found in indices.items():
        files.append(_map_file(names[i], names[j]))
        meaning = f"line n = vertex of {names[j]} that vertex n of {names[i]} is mapped to"
        write_map(folder / files[-1], found, meaning=meaning)
    panels = []
    for i, mesh in enumerate(meshes):
        to_reference = None if i == middle else indices[i, middle]
        colors = reference if to_reference is None else pull_colors(reference, to_reference)
        files.append(f"shapes/{_plain(names[i])}.ply")
        write_mesh(folder / files[-1], mesh, colors)
        panels.append(Panel(mesh, colors, to_reference=to_reference))
    write_mesh(folder / REFERENCE, meshes[middle], reference)
    shown = [panels[middle], *(panel for i, panel in enumerate(panels) if i != middle)][:_SHOWN]
    write_html(folder / PAGE, _page(collection, Viewer(shown)))
    return files


def _page(collection: MatchedCollection, viewer: Viewer) -> str:
    n = len(collection.names)
    shown = "" if n == len(viewer.panels) else f" {len(viewer.panels)} of them are shown here."
    text = (
        f"All shapes have the colours of the vertices of {collection.reference} that they are mapped to.{shown} "
        f"{collection.text[0].upper()}{collection.text[1:]}."
    )
    return viewer_html(f"{n} shapes matched with {collection.reference}", viewer, lead=verdict(collection), text=text)


def verdict(collection: MatchedCollection) -> str:
    """Return a sentence on how well the maps of the pairs agreed before they were made to agree."""
    edges = collection.edges
    agreeing = len(edges) - len(collection.mended)
    said = f"the maps of {agreeing} of {counted(len(edges), 'pair')} agree with those of all others"
    replaced = counted(len(collection.mended), "was", "were")
    mended = f"; the other {replaced} replaced by what the others say" if collection.mended else ""
    return f"{_agreement(collection, said, mended)}{_untrusted(collection)}"


def _untrusted(collection: MatchedCollection) -> str:
    """Name the shapes of which less than 60 % have a trustworthy partner on the reference."""
    few = [f"{name} ({100 * share:.0f} %)" for name, share in collection.trusted.items() if share < 0.6]
    if not few:
        return ""
    return (
        f".  WARNING: shares of these shapes that have a trustworthy partner on {collection.reference}: "
        f"{', '.join(few)}; they may be of another kind, or parts"
    )


def _agreement(collection: MatchedCollection, said: str, mended: str) -> str:
    edges, away = collection.edges, np.array([edge.apart for edge in collection.edges])
    doubt = [n for n in collection.names if np.mean([e.mended for e in edges if n in (e.source, e.target)]) >= 0.5]
    if float(np.mean(away)) > 0.5:
        return f"WARNING: only {said}{mended}: these shapes may be of different kinds"
    return f"{said}{mended}" + (f".  WARNING: look at {', '.join(doubt)}, with whom few agree" if doubt else "")


def _account(collection: MatchedCollection, n_maps: int) -> dict[str, Any]:
    made, method = provenance(), collection.method
    described = str(method.descriptor) if isinstance(method, DescriptorMethod) else method.name
    return {
        "shapes": [
            {"name": m.name, "file": m.source or None, "vertices": m.n_vertices, "notes": list(s.notes)}
            for m, s in zip(collection.meshes, collection.subjects, strict=True)
        ],
        "reference": collection.reference,
        "maps": f"{n_maps} in maps/SOURCE_to_TARGET.txt: line n = vertex of TARGET; 0-based, -1 for none",
        "method": f"{collection.text}; descriptor {described}",
        "search": collection.refiner.parameters(),
        "verdict": verdict(collection),
        "trusted": dict(collection.trusted),
        "cycles": {
            "alone": _mean(collection.cycles.alone),
            "together": _mean(collection.cycles.together),
            "meaning": "mean |C_ij C_jk - C_ik| / sqrt(2 K) over triangles: 0 closes, 1 for unrelated maps",
        },
        "pairs": [
            {"source": e.source, "target": e.target, "cost": e.cost, "apart": e.apart, "mended": e.mended}
            for e in collection.edges
        ],
        "command": made.command,
        "commit": made.commit,
        "versions": made.versions,
    }


def _mean(values: Any) -> float | None:
    return float(np.mean(values)) if len(values) else None


def _plain(name: str) -> str:
    return re.sub(r"[^\w.+() -]", "_", name)


def _map_file(source: str, target: str) -> str:
    return f"maps/{_plain(source)}_to_{_plain(target)}.txt"
