"""``csm match source=a.off target=b.ply out=DIR``: match two meshes of your own."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from hydra.utils import instantiate
from omegaconf import DictConfig

from csm.commands.app import command
from csm.commands.groups import register
from csm.data.store import Store
from csm.errors import ConfigError
from csm.matching import DescriptorMethod, Method, match_meshes
from csm.viewer.match_folder import write_match

register("descriptor")


def run(cfg: DictConfig) -> dict[str, Any]:
    """Match and write the map, the coloured meshes, a picture page and an account; return counts."""
    if None in (cfg.source, cfg.target, cfg.out):
        raise ConfigError("match needs source=FILE target=FILE out=FOLDER")
    begun, folder = time.perf_counter(), Path(cfg.out)
    method, text = _method(cfg)
    match = match_meshes(cfg.source, cfg.target, method, store=Store(cfg.store), device=cfg.device)
    write_match(match, folder, text, time.perf_counter() - begun)
    print(
        f"{match.source.name} ({match.source.n_vertices} vertices) -> {match.target.name} "
        f"({match.target.n_vertices} vertices) by {text}; "
        f"{100 * match.coverage:.1f} % of the target is reached: {folder}"
    )
    return {"coverage": match.coverage, "vertices": match.source.n_vertices}


def _method(cfg: DictConfig) -> tuple[Method, str]:
    """Return the method, and what to call it."""
    if cfg.checkpoint is None:
        descriptor = instantiate(cfg.descriptor)
        return DescriptorMethod(descriptor), f"the descriptor {descriptor}"
    from csm.matching.network import load_model

    return load_model(cfg.checkpoint), f"the learned descriptor of {Path(cfg.checkpoint).name}"


main = command("match")(run)

if __name__ == "__main__":
    main()
