"""``csm bodies bodies.npz count=1000``: make human bodies to train on, from the body model `anny`."""

from __future__ import annotations

from csm.commands.main import run_as_program

if __name__ == "__main__":
    run_as_program(__file__)

from pathlib import Path
from typing import Any

from omegaconf import DictConfig

from csm._counts import counted
from csm._parallel import n_processes
from csm.commands.app import command
from csm.commands.outputs import require_file_place, require_new_in_sweep
from csm.data.bodies.archive import make_bodies
from csm.errors import ConfigError


def run(cfg: DictConfig) -> dict[str, Any]:
    """Write the bodies; return their number."""
    if cfg.out is None:
        raise ConfigError("bodies need a place: csm bodies bodies.npz")
    out = Path(cfg.out)
    require_file_place(out)
    require_new_in_sweep(out)
    if out.exists() and not cfg.overwrite:
        raise ConfigError(f"{out}: is there already; overwrite=true replaces it")
    made = make_bodies(out, cfg.count, cfg.seed, n_processes(cfg.workers, cfg.count))
    n = counted(len(made.names), "body")
    print(f"{n} of {made.load(made.names[0]).mesh.n_vertices} vertices: {out} ({out.stat().st_size / 2**20:.1f} MiB)")
    print(f"to train on them too: csm train experiment=humans 'data.also=[{out}]'")
    return {"bodies": len(made.names)}


main = command("bodies")(run)
