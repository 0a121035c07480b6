"""What a match of two meshes leaves in a folder: the map, coloured meshes, a page to turn them around, an account."""

from __future__ import annotations

import os
import tempfile
import webbrowser
from pathlib import Path
from typing import Any

from csm.evaluation.provenance import provenance
from csm.matching import DescriptorMethod, Match
from csm.mesh.io import atomic_path, write_map, write_mesh
from csm.mesh.io.guard import refusals
from csm.mesh.io.owned import MATCH, put_in_place, require_not_input, require_own
from csm.mesh.shape import Mesh
from csm.viewer.colors import position_colors, pull_colors
from csm.viewer.html import Panel, Viewer, viewer_html, write_html

FILES = ("map.txt", "map.npz", "confidence.txt", "source.ply", "target.ply", "match.html")
"""What `write_match` writes, besides its account."""

ACCOUNT = MATCH
"""How the match was made; it has the hashes of the other files."""


def save_match(match: Match, folder: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
    """Write a match to a folder, see `csm.matching.Match.save`, and return the folder.

    Raises
    ------
    DataError
        If a file of such a name is there that csm did not write, or the folder cannot be written.
    """
    folder = Path(folder)
    files = [folder / name for name in FILES]
    require_not_input([*files, folder / ACCOUNT], [Path(m.source) for m in (match.source, match.target) if m.source])
    require_own(files, folder / ACCOUNT, overwrite)
    write_match(match, folder, in_words(match))
    return folder


def show_match(match: Match) -> Path:
    """Write the page of a match to a temporary folder, open it in the browser, and return the file."""
    path = Path(tempfile.mkdtemp(prefix="csm-match-")) / "match.html"
    write_html(path, match_page(match, in_words(match)))
    webbrowser.open(path.as_uri())
    return path


def in_words(match: Match) -> str:
    """Return the method of a match in words.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> in_words(SimpleNamespace(method=SimpleNamespace(name="mine")))
    'the descriptor mine'
    """
    method = match.method
    return f"the descriptor {method.descriptor if isinstance(method, DescriptorMethod) else method.name}"


def write_match(match: Match, folder: Path, method: str, seconds: float | None = None) -> None:
    """Write the `FILES` of a match and its `ACCOUNT`.

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
        How long it took, if that is known.
    """
    with refusals(folder, "written"):
        folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=".csm-", dir=folder) as staged:
        account = _write_files(match, Path(staged), method)
        took = {} if seconds is None else {"seconds": round(seconds, 2)}
        put_in_place(Path(staged), FILES, folder / ACCOUNT, {**account, **took})


def _write_files(match: Match, folder: Path, method: str) -> dict[str, Any]:
    """Write all files but the account, which is returned."""
    source, target, indices = match.source, match.target, match.indices
    meaning = f"line i = vertex of {target.name} that vertex i of {source.name} is mapped to"
    write_map(folder / "map.txt", indices, meaning=meaning)
    write_map(folder / "map.npz", indices, meaning=f"{meaning}; 0-based, -1 for none")
    reference = position_colors(target)
    colors = pull_colors(reference, indices)
    _write_confidence(folder / "confidence.txt", match)
    write_mesh(folder / "source.ply", source, colors)
    write_mesh(folder / "target.ply", target, reference)
    write_html(folder / "match.html", match_page(match, method))
    return _account(match, meaning, method)


def match_page(match: Match, method: str) -> str:
    """Return the page that shows both meshes of a match."""
    reference, (here, there) = position_colors(match.target), match.features or (None, None)
    viewer = Viewer(
        [
            Panel(
                match.source,
                pull_colors(reference, match.indices),
                to_reference=match.indices,
                confidence=match.confidence.values,
                features=here,
            ),
            Panel(match.target, reference, features=there),
        ],
        reference=1,
        confidence_label="confidence: the probability that the partner is near the truth",
    )
    title, verdict = f"{match.source.name} → {match.target.name}", f"{match.confidence.verdict}."
    return viewer_html(title, viewer, lead=verdict, text=_caption(match, method))


def _write_confidence(path: Path, match: Match) -> None:
    head = f"# line i = confidence, from 0 to 1, in the match of vertex i of {match.source.name}; 0-based"
    with atomic_path(path) as temporary:
        lines = [" ".join(head.split()), *(f"{value:.4f}" for value in match.confidence.values)]
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _caption(match: Match, method: str) -> str:
    notes = "".join(f"\n\n**Note.** {note}." for note in match.notes)
    return _what_is_shown(match, method) + notes


def _what_is_shown(match: Match, method: str) -> str:
    source, target = match.source.name, match.target.name
    return (
        f"Every vertex of {source} is mapped to a vertex of {target} by {made_by(match, method)}. "
        "The target is coloured by position; a source vertex has the colour of its match. "
        f"{100 * match.coverage:.1f} % of the target vertices are reached."
    )


def made_by(match: Match, method: str) -> str:
    """Say how the map was made: by which neighbour or classifier, on which descriptor, and what refined it."""
    rule = match.matcher.name.partition("+")[0]
    how = f"{rule} neighbour in" if rule != "argmax" else "the classifier on"
    return f"{how} {method}" + (f", {match.refinement}" if match.refinement else "")


def _account(match: Match, meaning: str, method: str) -> dict[str, Any]:
    made = provenance()
    return {
        "source": _of_mesh(match.source),
        "target": _of_mesh(match.target),
        "map": f"{meaning}; 0-based, -1 for none",
        "method": made_by(match, method),
        "matcher": match.matcher.name,
        "parameters": dict(match.method.key),
        "unmatched": match.vertex_map.n_unmatched,
        "coverage": match.coverage,
        "returned": match.confidence.returned,
        "trusted": match.confidence.trusted,
        "ambiguous": match.confidence.ambiguous,
        "strained": match.confidence.strained,
        "verdict": match.confidence.verdict,
        "notes": list(match.notes),
        "command": made.command,
        "commit": made.commit,
        "versions": made.versions,
    }


def _of_mesh(mesh: Mesh) -> dict[str, Any]:
    return {"name": mesh.name, "file": mesh.source or None, "vertices": mesh.n_vertices}
