"""Weights of a trained network that another training begins with."""

from __future__ import annotations

import json
from typing import Any

import torch

from csm.descriptors.presets import from_parameters, preset_name
from csm.errors import ConfigError
from csm.learning.describer import Describer
from csm.learning.module import CSMModule

_CLASSIFIER = "classifier."
_FREE = {"dropout", "products", "momentum"}  # options of networks that weights can be trained on with


def origin(source: Describer) -> dict[str, Any]:
    """Return what a new training remembers of the network that it begins with: its name, set and epochs."""
    training = source.settings.get("training") or {}
    return {key: training.get(key) for key in ("name", "set", "epochs")}


def require_same_trunk(module: CSMModule, source: Describer, label: str) -> None:
    """Raise unless a training can begin with the weights of a trained network.

    Parameters
    ----------
    module
        What is to be trained; its tensors may be without memory.
    source
        The trained network.
    label
        What messages call it.

    Raises
    ------
    ConfigError
        If their inputs or layers differ; the classifier and the classifiers of further templates may.
    """
    wanted, given = (_plain(each, "descriptor") for each in (module, source))
    if wanted != given:
        differing = sorted(key for key in {*wanted, *given} if wanted.get(key) != given.get(key))
        raise ConfigError(
            f"pretrained={label}: its input is another descriptor ({given['name']}; different: "
            f"{', '.join(differing)}); {_wanted(given)}"
        )
    if (module.inputs is None) != (source.inputs is None):
        raise ConfigError(
            f"pretrained={label}: learning.standardise is {source.inputs is not None} there; it must be the same here"
        )
    model, other = (_plain(each, "network") for each in (module, source))
    if changed := sorted(key for key in (model.keys() & other.keys()) - _FREE if model[key] != other[key]):
        raise ConfigError(
            f"pretrained={label}: the model is another one (different: {', '.join(changed)}); choose the model that it "
            "was trained with"
        )
    here, there = ({name: tuple(tensor.shape) for name, tensor in _trunk(each).items()} for each in (module, source))
    if differing := sorted(name for name in here.keys() | there.keys() if here.get(name) != there.get(name)):
        raise ConfigError(
            f"pretrained={label}: its layers are others than those of the model (they differ in "
            f"{', '.join(differing[:3])}); choose the model that it was trained with"
        )


def take_over(module: CSMModule, source: Describer) -> bool:
    """Give a module the weights of a trained network, and return whether its classifier was taken, too.

    What the layers have learned is relative to the scale of their input, which is therefore kept.  The classifier is
    taken where both were trained on a set of one name with as many template points; elsewhere it stays as it was drawn.
    """
    weights = _trunk(source)
    linear = source.network.classifier
    same = (
        source.has_classifier
        and (module.settings.get("training") or {}).get("set") == origin(source)["set"]
        and module.network.classifier.weight.shape == linear.weight.shape
    )
    if same:
        weights |= {f"network.{_CLASSIFIER}{name}": tensor for name, tensor in linear.state_dict().items()}
    own = module.state_dict()
    with torch.no_grad():
        for name, tensor in weights.items():
            own[name].copy_(tensor)
    return bool(same)


def _wanted(given: dict[str, Any]) -> str:
    """Say which descriptor a training has to take, by its preset if it is one."""
    name = preset_name(from_parameters(**given))
    if name is None:
        return "give the training the descriptor of that network"
    return f"wanted descriptor={name}, or a recipe that has it: recipe=own has that of the network humans"


def _plain(module: Describer, part: str) -> dict[str, Any]:
    """Return a part of the settings as json has it, where a tuple is a list."""
    found: dict[str, Any] = json.loads(json.dumps(module.settings[part]))
    return found


def _trunk(module: Describer) -> dict[str, torch.Tensor]:
    """Return the weights of the layers before the classifier and, where the input is standardised, its scale."""
    found = {
        f"network.{name}": tensor
        for name, tensor in module.network.state_dict().items()
        if not name.startswith(_CLASSIFIER)
    }
    return found if module.inputs is None else found | module.inputs.state_dict(prefix="inputs.")
