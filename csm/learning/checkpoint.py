"""Reading trained networks back, and writing them as files that anybody can read: safetensors and json."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError
from safetensors.torch import load_file, save_file
from torch import Tensor

from csm.errors import ConfigError, CsmError, DataError
from csm.learning.describer import Describer
from csm.learning.places import LATER
from csm.mesh.io import atomic_path, read_bytes

WEIGHTS, SETTINGS = "model.safetensors", "model.json"


def export_module(module: Describer, folder: Path, *, classifier: bool = False, half: bool = False) -> Path:
    """Write a trained network to ``model.safetensors`` and its hyper-parameters to ``model.json``.

    Parameters
    ----------
    module
        The trained module.
    folder
        Where the two files go; it is made if needed.
    classifier
        Also keep the classifier over the template vertices.  Matching needs it where the network describes by places
        (it is kept then in any case), and it is nine tenths of the weights.
    half
        Write the network's weights in half precision.

    Returns
    -------
    Path
        The json file, which `load_module` and ``checkpoint=`` of the commands take.
    """
    weights = {
        name: _written(name, tensor, half)
        for name, tensor in module.weights().items()
        if classifier or module.places is not None or not name.startswith("classifier.")
    }
    with atomic_path(folder / WEIGHTS) as temporary:
        save_file(weights, temporary)
    with atomic_path(folder / SETTINGS) as temporary:
        temporary.write_text(json.dumps(dict(module.settings), indent=1) + "\n")
    return folder / SETTINGS


def _written(name: str, tensor: Tensor, half: bool) -> Tensor:
    plain = tensor.detach().cpu().contiguous()
    if not half or not plain.is_floating_point() or name.startswith("inputs."):
        return plain
    small = plain.half()
    if not torch.isfinite(small).all():
        raise ConfigError(f"{name} has numbers that half precision cannot hold; export it without half")
    return small


def load_module(path: str | os.PathLike[str]) -> Describer:
    """Load a trained network: a Lightning checkpoint of ``csm train``, or an export, by either of its files.

    Nothing in the files is executed, and no configuration is needed.

    Raises
    ------
    DataError
        If there is no such file, or it is no network of csm.
    """
    if not isinstance(path, str | os.PathLike):
        raise ConfigError(f"a checkpoint is given by its path, got a {type(path).__name__}")
    path = Path(path)
    if path.suffix == Path(WEIGHTS).suffix:  # the settings beside the weights say what they are of
        path = path.with_suffix(Path(SETTINGS).suffix)
    if path.is_dir():
        held = [file for file in ("model.ckpt", SETTINGS, f"export/{SETTINGS}") if (path / file).is_file()]
        inside = f"; wanted {path / held[0]}" if held else ", and no model.ckpt or model.json is in it"
        raise DataError(f"{path}: a folder, not a checkpoint{inside}")
    if not path.is_file():
        raise DataError(
            f"{path}: there is no such checkpoint; csm train writes model.ckpt into its output folder, and csm brings "
            "the networks humans and humans_parts"
        )
    try:
        found = _load_export(path) if path.suffix == ".json" else _load_checkpoint(path)
    except CsmError:
        raise
    except Exception as error:  # a foreign file can trip the readers in any way
        why = (str(error) or type(error).__name__).splitlines()[0]
        raise DataError(f"{path}: not a checkpoint of csm ({why})") from error
    if found.places is not None and not found.places.is_whole:
        raise DataError(
            f"{path}: the weights are damaged, or were changed: places.twins does not hold a point of the template, "
            f"0 to {len(found.places.twins) - 1}, for each of them"
        )
    return found


def read_checkpoint(path: Path) -> dict[str, Any]:
    """Return the content of a checkpoint of ``csm train``, whose plain data has been looked at; nothing is executed.

    Raises
    ------
    DataError
        If there is no such file, it is damaged, or it is of another program.
    """
    if not path.is_file():
        raise DataError(f"{path}: there is no such checkpoint; csm train writes model.ckpt into its output folder")
    try:
        found = torch.load(path, map_location="cpu", weights_only=True)
    except Exception as error:  # a damaged archive makes PyTorch raise whatever it trips over
        if "weights_only" in str(error):
            raise DataError(
                f"{path}: not a checkpoint of csm: it holds more than numbers and plain data, and csm loads nothing "
                "that could run code"
            ) from error
        why = (str(error) or type(error).__name__).splitlines()[0]
        raise DataError(f"{path}: not a checkpoint of csm, or it is damaged or cut short ({why})") from error
    if not isinstance(found, dict) or not {"state_dict", "hyper_parameters"} <= found.keys():
        raise DataError(f"{path}: not a checkpoint of csm: it has no weights with hyper-parameters")
    require_plain(found["hyper_parameters"], path)
    return found


def require_plain(hparams: Any, path: Path) -> None:
    """Raise a DataError if hyper-parameters lack what a network is rebuilt from, or have something odd in its place."""
    wanted: dict[str, tuple[type, ...]] = {
        "network": (dict,),
        "descriptor": (dict,),
        "in_channels": (int,),
        "n_classes": (int,),
        "basis_k": (int,),
    }
    if not isinstance(hparams, Mapping):
        raise DataError(f"{path}: not a checkpoint of csm: its hyper-parameters are a {type(hparams).__name__}")
    for key, kinds in wanted.items():
        value = hparams.get(key, 128 if key == "basis_k" else None)
        if not isinstance(value, kinds) or (isinstance(value, dict) and not isinstance(value.get("name"), str)):
            raise DataError(
                f"{path}: not a checkpoint of csm, or it was changed: {key} is {value!r} in its hyper-parameters"
            )
    if not isinstance(hparams.get("training") or {}, Mapping):
        raise DataError(f"{path}: not a checkpoint of csm, or it was changed: training is {hparams['training']!r}")


def _load_checkpoint(path: Path) -> Describer:
    found = read_checkpoint(path)
    module = Describer.of(found["hyper_parameters"])
    module.load_state_dict({name: x for name, x in found["state_dict"].items() if not name.startswith("others.")})
    return module


def _load_export(path: Path) -> Describer:
    hparams = json.loads(read_bytes(path))
    require_plain(hparams, path)
    module = Describer.of(hparams)
    beside = path.with_suffix(Path(WEIGHTS).suffix)
    try:
        weights = load_file(beside)
    except (OSError, SafetensorError) as error:
        raise DataError(f"{beside}: cannot be read ({error}); it belongs beside {path.name}") from error
    own = {name: tensor.shape for name, tensor in module.weights().items()}
    given = {name: tensor.shape for name, tensor in weights.items()}
    for name in sorted(own.keys() | given.keys()):
        needless = name.startswith("classifier.") and module.places is None
        spared = name not in given and (needless or name.removeprefix("places.") in LATER)
        if not spared and own.get(name) != given.get(name):
            raise DataError(f"{path}: the weights beside it belong to another network (they differ in {name})")
    with torch.no_grad():
        for name, tensor in module.weights().items():
            if name in weights:
                tensor.copy_(weights[name])
    module.has_classifier = "classifier.weight" in weights
    return module
