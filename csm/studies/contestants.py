"""What the figures of damage and of errors on a body compare: descriptors as they are, and trained networks."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import torch

from csm.data.prepare import compute_features
from csm.data.store import Store
from csm.descriptors.base import record
from csm.descriptors.presets import preset
from csm.errors import ConfigError
from csm.learning.export import load_module
from csm.learning.meshes import describe_mesh
from csm.learning.module import CSMModule
from csm.mesh.shape import Mesh
from csm.studies.bodies import Bodies, label
from csm.studies.contenders import row_title
from csm.studies.study import Context


@dataclass(frozen=True, eq=False)
class Contestant:
    """A way to describe a mesh, and what tells it from others in keys of what is kept."""

    key: str
    describe: Callable[[Mesh], torch.Tensor]


def contestants(
    descriptors: Sequence[str], checkpoints: Mapping[str, str] | None, context: Context, bodies: Bodies
) -> dict[str, Contestant]:
    """Return presets of descriptors by their labels, and trained networks by the names that they are given.

    Parameters
    ----------
    descriptors
        Names of presets.
    checkpoints
        Name -> file of a trained network.  None takes, from the cells of the learned tables in the folder of artefacts,
        the networks of seed 0 that were trained on these bodies.
    context
        Where artefacts are.
    bodies
        What is matched.

    Raises
    ------
    ConfigError
        If there is none, or a preset is unknown.
    DataError
        If a checkpoint cannot be read.
    """
    modules = {name: load_module(Path(path)) for name, path in (checkpoints or {}).items()}
    if checkpoints is None:
        modules = trained_on(bodies.original.name, context.out)
    if not descriptors and not modules:
        raise ConfigError("there is nothing to compare: name a descriptor, or a checkpoint as checkpoints={NAME:PATH}")
    found = {label(name): _descriptor(name, context.store) for name in descriptors}
    return found | {name: _network(module, context.store) for name, module in modules.items()}


def trained_on(name: str, out: Path) -> dict[str, CSMModule]:
    """Return the networks of seed 0 in the cells of learned tables that were trained on the set of this name.

    Only methods with a title count, so that an ablation's many settings of one method do not come along.
    """
    paths = {path.parent.parent.name: path for path in sorted(out.glob("*/*/seed0/model.ckpt"))}
    found = {row: load_module(path) for row, path in paths.items() if row_title(row) != row}
    return {row_title(row): module for row, module in found.items() if module.hparams["training"]["set"] == name}


def _descriptor(name: str, store: Store) -> Contestant:
    descriptor = preset(name)
    return Contestant(
        json.dumps(record(descriptor), sort_keys=True, default=str),
        lambda mesh: torch.as_tensor(compute_features(mesh, descriptor, store)),
    )


def _network(module: CSMModule, store: Store) -> Contestant:
    digest = hashlib.sha256()
    for name, tensor in sorted(module.state_dict().items()):
        digest.update(name.encode() + tensor.detach().cpu().numpy().tobytes())
    return Contestant(digest.hexdigest(), lambda mesh: describe_mesh(module, mesh, store))
