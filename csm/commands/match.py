"""``csm match source=a.off target=b.ply out=DIR``: match two meshes of your own."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from hydra.utils import instantiate
from omegaconf import DictConfig

from csm.commands.app import command, write_json
from csm.data.prepare import compute_features
from csm.data.store import Store
from csm.errors import ConfigError
from csm.evaluation.matching import Match, match_features
from csm.evaluation.provenance import provenance
from csm.learning.export import load_module
from csm.learning.meshes import describe_mesh
from csm.mesh.io import read_mesh, write_map, write_mesh
from csm.mesh.shape import Mesh
from csm.viewer.colors import position_colors, pull_colors
from csm.viewer.html import Panel, Viewer, viewer_html, write_html


@dataclass(frozen=True, eq=False)
class Matched:
    """Two meshes and the map between them, from every source vertex to a target vertex."""

    source: Mesh
    target: Mesh
    match: Match
    features: str


def run(cfg: DictConfig) -> dict[str, Any]:
    """Match and write the map, the coloured meshes, a picture page and an account; return counts."""
    for option in ("source", "target", "out"):
        if cfg[option] is None:
            raise ConfigError("match needs source=FILE target=FILE out=FOLDER")
    begun = time.perf_counter()
    matched = match_files(cfg)
    folder = Path(cfg.out)
    write_match(matched, folder, time.perf_counter() - begun)
    print(
        f"{matched.source.name} ({matched.source.n_vertices} vertices) -> {matched.target.name} "
        f"({matched.target.n_vertices} vertices) by {matched.features}; "
        f"{100 * matched.match.coverage:.1f} % of the target is reached: {folder}"
    )
    return {"coverage": matched.match.coverage, "vertices": matched.source.n_vertices}


def match_files(cfg: DictConfig) -> Matched:
    """Read both meshes, compute their descriptors and match them by nearest neighbour."""
    source, target = read_mesh(cfg.source), read_mesh(cfg.target)
    store = Store(cfg.store)
    if cfg.checkpoint is None:
        descriptor = instantiate(cfg.descriptor)
        text = f"the descriptor {descriptor}"
        rows = [torch.as_tensor(compute_features(mesh, descriptor, store)) for mesh in (source, target)]
    else:
        module = load_module(Path(cfg.checkpoint))
        text = f"the learned descriptor of {Path(cfg.checkpoint).name}"
        rows = [describe_mesh(module, mesh, store) for mesh in (source, target)]
    match = match_features(*rows, source_name=source.name, target_name=target.name)
    return Matched(source, target, match, text)


def write_match(matched: Matched, folder: Path, seconds: float) -> None:
    """Write ``map.txt``, ``map.npz``, ``source.ply``, ``target.ply``, ``match.html`` and ``match.json``.

    The target is coloured by position, and every source vertex has the colour of the vertex that it is mapped to.
    """
    source, target, indices = matched.source, matched.target, matched.match.indices
    meaning = f"line i = vertex of {target.name} that vertex i of {source.name} is mapped to"
    for name in ("map.txt", "map.npz"):
        write_map(folder / name, indices, meaning=meaning)
    reference = position_colors(target)
    colors = pull_colors(reference, indices)
    write_mesh(folder / "source.ply", source, colors)
    write_mesh(folder / "target.ply", target, reference)
    write_json(folder / "match.json", _account(matched, meaning, seconds))
    viewer = Viewer([Panel(source, colors, to_reference=indices), Panel(target, reference)], reference=1)
    write_html(folder / "match.html", viewer_html(f"{source.name} → {target.name}", viewer, text=_caption(matched)))


def _caption(matched: Matched) -> str:
    return (
        f"Every vertex of {matched.source.name} is mapped to the vertex of {matched.target.name} that is nearest in "
        f"{matched.features}. The target is coloured by position; a source vertex has the colour of its match. "
        f"{100 * matched.match.coverage:.1f} % of the target vertices are reached."
    )


def _account(matched: Matched, meaning: str, seconds: float) -> dict[str, Any]:
    made = provenance()
    return {
        "source": {"name": matched.source.name, "vertices": matched.source.n_vertices},
        "target": {"name": matched.target.name, "vertices": matched.target.n_vertices},
        "map": f"{meaning}; 0-based",
        "method": f"nearest neighbour in {matched.features}",
        "coverage": matched.match.coverage,
        "seconds": round(seconds, 2),
        "command": made.command,
        "commit": made.commit,
        "versions": made.versions,
    }


main = command("match")(run)

if __name__ == "__main__":
    main()
