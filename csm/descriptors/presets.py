"""Descriptors by name, as experiments and the command line ask for them."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

from csm.descriptors.acd import ACD
from csm.descriptors.add import ADD
from csm.descriptors.amks import AMKS
from csm.descriptors.asmwd import ASMWD
from csm.descriptors.awft import AWFT
from csm.descriptors.base import Descriptor
from csm.descriptors.constant import Constant
from csm.descriptors.coordinates import Coordinates
from csm.descriptors.dep import DEP
from csm.descriptors.gps import GPS
from csm.descriptors.hks import HKS
from csm.descriptors.shot import SHOT
from csm.descriptors.smwd import SMWD
from csm.descriptors.stack import Stack
from csm.descriptors.weds import WEDS
from csm.descriptors.wft import WFT
from csm.descriptors.wks import WKS
from csm.errors import ConfigError

PRESETS: dict[str, Descriptor] = {
    "acd": ACD.own(),
    "acd_paper": ACD(),
    "acd_release": ACD.release(),
    "acd_release_frame": ACD.release(frame="released", sweeps=10),
    "acd_isotropic": ACD(alpha=0.0, angles=1),
    "hks": HKS(),
    "hks_diffusionnet": HKS(k=128, n_times=16, scaled=False, first=0.01, last=1.0),
    "wks": WKS(),
    "wks_functional_map": WKS(variant="functional_map"),
    "shot": SHOT(),
    "dep": DEP(),
    "amks": AMKS(),
    "smwd": SMWD(),
    "smwd_mexican": SMWD(variant="mexican"),
    "weds": WEDS(),
    "wft": WFT(),
    "awft": AWFT(),
    "asmwd": ASMWD(),
    "add": ADD(),
    "gps": GPS(),
    "constant": Constant(),
    "xyz": Coordinates(),
}
"""Named settings; "acd_release_frame" reproduces the authors' output with their frame, world axes and all."""

_FAMILIES: dict[str, Any] = {descriptor.name: type(descriptor) for descriptor in PRESETS.values()}


def preset(name: str, **overrides: Any) -> Descriptor:
    """Return the descriptor called `name`, with some parameters replaced.

    Raises
    ------
    ConfigError
        If the name or a parameter is unknown, or a value is out of range.

    Examples
    --------
    >>> preset("hks", n_times=16)
    HKS(k=300, n_times=16, scaled=True, first=None, last=None)
    """
    if name not in PRESETS:
        raise ConfigError(f"there is no descriptor {name!r}; there are {', '.join(PRESETS)}")
    descriptor: Any = PRESETS[name]
    known = [field.name for field in fields(descriptor)]
    unknown = [key for key in overrides if key not in known]
    if unknown:
        raise ConfigError(f"{name} has no parameter {', '.join(unknown)}; it has {', '.join(known)}")
    changed: Descriptor = replace(descriptor, **overrides)
    return changed


def from_parameters(name: str, **parameters: Any) -> Descriptor:
    """Return the descriptor of a family with all its parameters, as a checkpoint or the store records it.

    Raises
    ------
    ConfigError
        If the family or a parameter is unknown, or a value is out of range.

    Examples
    --------
    >>> from_parameters("hks", **HKS(n_times=16).parameters()) == HKS(n_times=16)
    True
    """
    if name == Stack.name:
        return Stack({key: from_parameters(**part) for key, part in parameters["parts"].items()})
    if name not in _FAMILIES:
        raise ConfigError(f"there is no descriptor family {name!r}; there are {', '.join(_FAMILIES)}")
    try:
        descriptor: Descriptor = _FAMILIES[name](**parameters)
    except TypeError as error:
        raise ConfigError(f"descriptor {name}: {error}") from error
    return descriptor
