"""``csm match a.off b.ply out=DIR``: match two meshes of your own, or all of a folder (folder=DIR)."""

from __future__ import annotations

from csm.commands.main import run_as_program

if __name__ == "__main__":
    run_as_program(__file__)

import time
from pathlib import Path
from typing import Any

from hydra.core.hydra_config import HydraConfig
from hydra.utils import instantiate
from omegaconf import DictConfig

from csm._counts import counted
from csm._signals import saying
from csm.commands.app import command
from csm.commands.groups import plain, register
from csm.commands.outputs import BEGINS_AGAIN, OVERWRITE, require_new_in_sweep, require_place
from csm.data.store import Store
from csm.descriptors.presets import preset_name
from csm.errors import ConfigError
from csm.matching import DescriptorMethod, Method, match_meshes
from csm.matching.shipped import shipped_models
from csm.matching.suited import AUTO
from csm.mesh.io.owned import require_not_input, require_own
from csm.viewer.match_folder import ACCOUNT, FILES, made_by, write_match

register("descriptor")


def run(cfg: DictConfig) -> dict[str, Any]:
    """Match and write the map, the coloured meshes, a picture page and an account; return counts."""
    if cfg.folder is not None:
        from csm.commands.collection import run_collection

        method, file = _method(cfg)
        if isinstance(method, str):
            raise ConfigError("model=auto chooses for two meshes; with folder= say model=humans, or leave it out")
        return run_collection(cfg, method, _called(method, file))
    if None in (cfg.source, cfg.target):
        raise ConfigError("match needs two meshes: csm match SOURCE TARGET [OUT], or a folder of them: folder=DIR")
    if cfg.pairs != "auto":
        raise ConfigError(f"pairs={cfg.pairs} goes with folder=DIR only, whose meshes make several pairs")
    for key in ("matching", "refine"):
        if not isinstance(cfg[key], str):
            raise ConfigError(f"{key}={plain(cfg[key])}: a match takes one of them; csm evaluate takes a list")
    begun = time.perf_counter()
    folder = Path(cfg.out or f"{Path(cfg.source).stem}_to_{Path(cfg.target).stem}")
    _require_place(folder, [Path(cfg.source), Path(cfg.target)], cfg.overwrite)
    method, file = _method(cfg)
    with saying(lambda: BEGINS_AGAIN):
        match = match_meshes(
            cfg.source,
            cfg.target,
            method,
            cfg.matching,
            cfg.refine,
            clean=cfg.clean,
            store=Store(cfg.store),
            device=cfg.device,
        )
    text = _called(match.method, file)
    write_match(match, folder, text, time.perf_counter() - begun)
    for note in match.notes:
        print(f"note: {note}")
    source, target, unmatched = match.source, match.target, match.vertex_map.n_unmatched
    print(
        f"{source.name} ({counted(source.n_vertices, 'vertex')}) -> {target.name} "
        f"({counted(target.n_vertices, 'vertex')}) by "
        f"{made_by(match, text)}\n"
        + (f"{counted(unmatched, 'vertex has', 'vertices have')} no partner; " if unmatched else "")
        + f"{100 * match.coverage:.1f} % of the target's vertices are reached\n{match.confidence.verdict}\n"
        f"{folder}: map.txt, match.html (to look at), match.json (how it was made)"
    )
    return {"coverage": match.coverage, "trusted": match.confidence.trusted, "vertices": match.source.n_vertices}


def _require_place(folder: Path, inputs: list[Path], overwrite: bool) -> None:
    require_place(folder)
    require_new_in_sweep(folder)
    outputs = [folder / name for name in (*FILES, ACCOUNT)]
    require_not_input(outputs, inputs)
    require_own(outputs[:-1], outputs[-1], overwrite, OVERWRITE)


def _method(cfg: DictConfig) -> tuple[Method | str, str]:
    """Return the method, or `AUTO` where the meshes decide, and the name of the file that it is of."""
    given = cfg.checkpoint if cfg.checkpoint is not None else cfg.model
    if cfg.checkpoint is not None and cfg.model is not None:
        raise ConfigError(f"checkpoint={cfg.checkpoint} together with model={cfg.model}: a match takes one network")
    if given is None:
        return DescriptorMethod(instantiate(cfg.descriptor)), ""
    chosen = [text for text in HydraConfig.get().overrides.task if text.lstrip("+~").startswith("descriptor")]
    if chosen:
        raise ConfigError(f"{chosen[0]} together with a network ({given}), which brings its descriptor; leave one out")
    if cfg.model is not None and cfg.model not in (AUTO, *shipped_models()):
        raise ConfigError(
            f"model={cfg.model}: csm brings no such network; wanted {' or '.join(shipped_models())} or {AUTO}; "
            "one of your own is given by checkpoint=FILE"
        )
    from csm.matching.network import load_model

    return (AUTO, "") if cfg.model == AUTO else (load_model(given), Path(given).name)


def _called(method: Method, file: str) -> str:
    """Return what to call a method in a sentence."""
    if isinstance(method, DescriptorMethod):
        return f"the descriptor {preset_name(method.descriptor) or method.descriptor}"
    trained = getattr(method, "trained_on", "")
    return f"the learned descriptor of {file or method.name}" + (f" (trained on {trained})" if trained else "")


main = command("match")(run)
