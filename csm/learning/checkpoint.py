"""Reading trained networks back, and writing them as files that anybody can read: safetensors and json."""

from __future__ import annotations

import json
import os
from pathlib import Path

from safetensors import SafetensorError
from safetensors.torch import load_file, save_file

from csm.errors import CsmError, DataError
from csm.learning.module import CSMModule
from csm.mesh.io import atomic_path, read_bytes

WEIGHTS, SETTINGS = "model.safetensors", "model.json"


def export_module(module: CSMModule, folder: Path, *, classifier: bool = False) -> Path:
    """Write a trained network to ``model.safetensors`` and its hyper-parameters to ``model.json``.

    Parameters
    ----------
    module
        The trained module.
    folder
        Where the two files go; it is made if needed.
    classifier
        Also keep the classifier over the template vertices. Matching does not need it, and it is nine tenths of the
        weights.

    Returns
    -------
    Path
        The json file, which `load_module` and ``checkpoint=`` of the commands take.
    """
    weights = {
        name: tensor.detach().cpu().contiguous()
        for name, tensor in module.network.state_dict().items()
        if classifier or not name.startswith("classifier.")
    }
    with atomic_path(folder / WEIGHTS) as temporary:
        save_file(weights, temporary)
    with atomic_path(folder / SETTINGS) as temporary:
        temporary.write_text(json.dumps(dict(module.hparams), indent=1) + "\n")
    return folder / SETTINGS


def load_module(path: str | os.PathLike[str]) -> CSMModule:
    """Load a trained network: a Lightning checkpoint of ``csm train``, or the json file of an export.

    Nothing in the files is executed, and no configuration is needed.

    Raises
    ------
    DataError
        If there is no such file, or it is no network of csm.
    """
    path = Path(path)
    if not path.is_file():
        raise DataError(f"{path}: there is no such checkpoint; csm train writes model.ckpt into its output folder")
    try:
        return _load_export(path) if path.suffix == ".json" else _load_checkpoint(path)
    except CsmError:
        raise
    except Exception as error:  # a foreign file can trip the readers in any way
        why = (str(error) or type(error).__name__).splitlines()[0]
        raise DataError(f"{path}: not a checkpoint of csm ({why})") from error


def _load_checkpoint(path: Path) -> CSMModule:
    return CSMModule.load_from_checkpoint(path, map_location="cpu", weights_only=True)


def _load_export(path: Path) -> CSMModule:
    module = CSMModule(**json.loads(read_bytes(path)))
    try:
        weights = load_file(path.with_name(WEIGHTS))
    except (OSError, SafetensorError) as error:
        raise DataError(
            f"{path.with_name(WEIGHTS)}: cannot be read ({error}); it belongs beside {path.name}"
        ) from error
    own = {name: tensor.shape for name, tensor in module.network.state_dict().items()}
    given = {name: tensor.shape for name, tensor in weights.items()}
    for name in sorted(own.keys() | given.keys()):
        spared = name.startswith("classifier.") and name not in given
        if not spared and own.get(name) != given.get(name):
            raise DataError(f"{path}: the weights beside it belong to another network (they differ in {name})")
    module.network.load_state_dict(weights, strict=False)
    module.has_classifier = "classifier.weight" in weights
    return module
