"""``csm bodies bodies.npz count=1000``: make human bodies to train on, from the body model `anny`."""

from __future__ import annotations

from csm.commands.main import run_as_program

if __name__ == "__main__":
    run_as_program(__file__)

import re
import shlex
from pathlib import Path
from typing import Any

from omegaconf import DictConfig

from csm._counts import counted
from csm._parallel import n_processes
from csm.commands.app import command
from csm.commands.outputs import require_file_place, require_new_in_sweep
from csm.data.bodies.archive import make_bodies
from csm.errors import ConfigError

_PLAIN = re.compile(r"[\w./-]+", re.ASCII)  # names that Hydra's grammar takes without quotes


def run(cfg: DictConfig) -> dict[str, Any]:
    """Write the bodies; return their number."""
    if cfg.out is None:
        raise ConfigError("bodies need a place: csm bodies bodies.npz")
    out = Path(cfg.out)
    require_file_place(out)
    require_new_in_sweep(out)
    workers = n_processes(cfg.workers, cfg.count)
    made = make_bodies(out, cfg.count, cfg.seed, workers, overwrite=cfg.overwrite)
    n = counted(len(made.names), "body")
    print(f"{n} of {made.load(made.names[0]).mesh.n_vertices} vertices: {out} ({out.stat().st_size / 2**20:.1f} MiB)")
    also = shlex.quote("data.also=[{}]".format(out if _PLAIN.fullmatch(str(out)) else f"'{out}'"))
    print(f"to train on them too: csm train experiment=humans {also}")
    return {"bodies": len(made.names)}


main = command("bodies")(run)
