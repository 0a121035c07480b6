"""``csm describe a.off d.npz``: compute a descriptor of one mesh."""

from __future__ import annotations

from csm.commands.main import run_as_program

if __name__ == "__main__":
    run_as_program(__file__)

import json
from pathlib import Path
from typing import Any

import numpy as np
from hydra.core.hydra_config import HydraConfig
from hydra.utils import instantiate
from omegaconf import DictConfig

from csm._counts import counted
from csm.commands.app import command
from csm.commands.groups import register
from csm.commands.outputs import checksum, require_file_place, require_new_in_sweep, require_own_archive
from csm.descriptors.base import Descriptor
from csm.descriptors.presets import preset_name
from csm.errors import ConfigError
from csm.matching.subjects import subject_of
from csm.mesh.io import atomic_path
from csm.mesh.io.owned import require_not_input

register("descriptor")


ARRAYS = ("values", "columns", "descriptor", "parameters", "checksum")
"""What the archive holds; the checksum is that of the values.  Newer ones also name the `preset`."""


def run(cfg: DictConfig) -> dict[str, Any]:
    """Write values (N, Q), column names and parameters; return the size."""
    if cfg.mesh is None or cfg.out is None:
        raise ConfigError("describe needs a mesh and a place: csm describe MESH OUT.npz")
    out = Path(cfg.out)
    if out.suffix != ".npz":
        raise ConfigError(f"out={out}: descriptors are written as .npz")
    require_file_place(out)
    require_new_in_sweep(out)
    require_not_input([out], [Path(cfg.mesh)])
    require_own_archive(out, ARRAYS, cfg.overwrite)
    descriptor: Descriptor = instantiate(cfg.descriptor)
    subject = subject_of(cfg.mesh, cfg.clean)
    for note in subject.notes:
        print(f"note: {subject.given.label}: {note}")
    features = descriptor(subject.cleaned.mesh)
    at = subject.cleaned.vertex_map
    values = np.where(at[:, None] >= 0, features.values[at], np.nan)
    with atomic_path(out) as temporary:
        np.savez(
            temporary,
            values=values,
            columns=np.array(features.columns),
            descriptor=np.array(descriptor.name),
            parameters=np.array(json.dumps(descriptor.parameters())),
            preset=np.array(preset_name(descriptor) or ""),
            checksum=np.array(checksum(values)),
        )
    (n, columns), preset = values.shape, HydraConfig.get().runtime.choices["descriptor"]
    print(f"{subject.given.name}: {counted(n, 'vertex')}, {counted(columns, 'column')} of {preset}: {out}")
    return {"vertices": n, "columns": columns}


main = command("describe")(run)
