"""``csm describe mesh=a.off out=d.npz``: compute a descriptor of one mesh."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from hydra.utils import instantiate
from omegaconf import DictConfig

from csm.commands.app import command
from csm.commands.groups import register
from csm.descriptors.base import Descriptor
from csm.errors import ConfigError
from csm.mesh.check import require_usable
from csm.mesh.io import atomic_path, read_mesh

register("descriptor")


def run(cfg: DictConfig) -> dict[str, Any]:
    """Write values (N, Q), column names and parameters; return the size."""
    if cfg.mesh is None or cfg.out is None:
        raise ConfigError("describe needs mesh=FILE and out=FILE.npz")
    out = Path(cfg.out)
    if out.suffix != ".npz":
        raise ConfigError(f"out={out}: descriptors are written as .npz")
    mesh = read_mesh(cfg.mesh)
    descriptor: Descriptor = instantiate(cfg.descriptor)
    require_usable(mesh)
    features = descriptor(mesh)
    with atomic_path(out) as temporary:
        np.savez(
            temporary,
            values=features.values,
            columns=np.array(features.columns),
            descriptor=np.array(descriptor.name),
            parameters=np.array(json.dumps(descriptor.parameters())),
        )
    n, columns = features.values.shape
    print(f"{mesh.name}: {n} vertices, {columns} columns of {descriptor.name}: {out}")
    return {"vertices": n, "columns": columns}


main = command("describe")(run)

if __name__ == "__main__":
    main()
