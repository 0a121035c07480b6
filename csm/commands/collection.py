"""``csm match folder=DIR out=OUT``: match all meshes of a folder with each other."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from omegaconf import DictConfig

from csm._counts import counted
from csm._signals import saying
from csm.commands.outputs import BEGINS_AGAIN, OVERWRITE, require_new_in_sweep, require_place
from csm.data.store import Store
from csm.errors import ConfigError
from csm.matching import Method
from csm.matching.collection import match_collection
from csm.matching.collection.shapes import mesh_files
from csm.mesh.io.owned import require_not_input, require_own
from csm.viewer.collection_folder import ACCOUNT, places, require_pairs, verdict, write_collection


def run_collection(cfg: DictConfig, method: Method, text: str) -> dict[str, Any]:
    """Match the meshes of a folder and write maps, coloured meshes, a page and an account; return counts."""
    begun = time.perf_counter()
    if cfg.source is not None or cfg.target is not None:
        given = " ".join(f"{key}={cfg[key]}" for key in ("source", "target") if cfg[key] is not None)
        raise ConfigError(
            f"folder={cfg.folder} together with {given}: wanted either two meshes (csm match SOURCE TARGET) or a "
            "folder of them (csm match folder=DIR out=OUT)"
        )
    if cfg.matching != "nearest" or cfg.refine not in ("auto", "multistart"):
        raise ConfigError(
            f"folder={cfg.folder} with matching={cfg.matching} refine={cfg.refine}: a folder is matched by nearest and "
            "multistart only; leave these options out"
        )
    require_pairs(cfg.pairs)
    files = mesh_files(cfg.folder)
    out = Path(cfg.out or f"{Path(cfg.folder).expanduser().resolve().name}_matched")
    require_place(out)
    require_new_in_sweep(out)
    outputs = [out / name for name in places([path.stem for path in files])]
    require_not_input([*outputs, out / ACCOUNT], files)
    require_own(outputs, out / ACCOUNT, cfg.overwrite, OVERWRITE)
    with saying(lambda: BEGINS_AGAIN):
        found = match_collection(
            files, method, clean=cfg.clean, store=Store(cfg.store), device=cfg.device, workers=cfg.workers
        )
    seconds = time.perf_counter() - begun
    n_maps = write_collection(found, out, pairs=cfg.pairs, seconds=seconds, workers=cfg.workers)
    for mesh, subject in zip(found.meshes, found.subjects, strict=True):
        for note in subject.notes:
            print(f"note: {mesh.label}: {note}")
    for edge in found.mended:
        print(f"mended: {edge.source} - {edge.target}")
    print(
        f"{len(found.names)} shapes matched by {text}, reference {found.reference}\n{verdict(found)}\n{out}: "
        f"{counted(n_maps, 'map')} in maps/, coloured meshes in shapes/, collection.html (to look at), {ACCOUNT} (how "
        "it was made)"
    )
    return {"shapes": len(found.names), "pairs": len(found.edges), "mended": len(found.mended), "maps": n_maps}
