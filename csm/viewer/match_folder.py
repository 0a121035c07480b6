"""What a match of two meshes leaves in a folder: the map, coloured meshes, a page to turn them around, an account."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from csm.evaluation.provenance import provenance
from csm.matching.match import Match
from csm.mesh.io import atomic_path, write_map, write_mesh
from csm.viewer.colors import position_colors, pull_colors
from csm.viewer.html import Panel, Viewer, viewer_html, write_html


def write_match(match: Match, folder: Path, method: str, seconds: float) -> None:
    """Write ``map.txt``, ``map.npz``, ``source.ply``, ``target.ply``, ``match.html`` and ``match.json``.

    The target is coloured by position, and every source vertex has the colour of the vertex that it is mapped to.

    Parameters
    ----------
    match
        What to write.
    folder
        Where it goes; it is made if needed.
    method
        The method in words, such as "the descriptor ACD(...)".
    seconds
        How long it took.
    """
    source, target, indices = match.source, match.target, match.indices
    meaning = f"line i = vertex of {target.name} that vertex i of {source.name} is mapped to"
    for name in ("map.txt", "map.npz"):
        write_map(folder / name, indices, meaning=meaning)
    reference = position_colors(target)
    colors = pull_colors(reference, indices)
    write_mesh(folder / "source.ply", source, colors)
    write_mesh(folder / "target.ply", target, reference)
    with atomic_path(folder / "match.json") as temporary:
        temporary.write_text(json.dumps(_account(match, meaning, method, seconds), indent=1) + "\n", encoding="utf-8")
    viewer = Viewer([Panel(source, colors, to_reference=indices), Panel(target, reference)], reference=1)
    page = viewer_html(f"{source.name} → {target.name}", viewer, text=_caption(match, method))
    write_html(folder / "match.html", page)


def _caption(match: Match, method: str) -> str:
    return (
        f"Every vertex of {match.source.name} is mapped to the vertex of {match.target.name} that is nearest in "
        f"{method}. The target is coloured by position; a source vertex has the colour of its match. "
        f"{100 * match.coverage:.1f} % of the target vertices are reached."
    )


def _account(match: Match, meaning: str, method: str, seconds: float) -> dict[str, Any]:
    made = provenance()
    return {
        "source": {"name": match.source.name, "vertices": match.source.n_vertices},
        "target": {"name": match.target.name, "vertices": match.target.n_vertices},
        "map": f"{meaning}; 0-based",
        "method": f"{match.matcher.name} neighbour in {method}",
        "coverage": match.coverage,
        "seconds": round(seconds, 2),
        "command": made.command,
        "commit": made.commit,
        "versions": made.versions,
    }
