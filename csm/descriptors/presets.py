"""Descriptors by name, as experiments and the command line ask for them."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

from csm.descriptors.base import Descriptor
from csm.descriptors.chebyshev import ACD
from csm.descriptors.heat import HKS
from csm.descriptors.wave import WKS
from csm.errors import ConfigError

PRESETS: dict[str, Descriptor] = {
    "acd_paper": ACD(),
    "acd_release": ACD.release(),
    "acd_release_frame": ACD.release(frame="released", sweeps=10),
    "acd_isotropic": ACD(alpha=0.0, angles=1),
    "hks": HKS(),
    "wks": WKS(),
    "wks_functional_map": WKS(variant="functional_map"),
}
"""Named settings; "acd_release_frame" reproduces the authors' output with their frame, world axes and all."""


def preset(name: str, **overrides: Any) -> Descriptor:
    """Return the descriptor called `name`, with some parameters replaced.

    Raises
    ------
    ConfigError
        If the name or a parameter is unknown, or a value is out of range.

    Examples
    --------
    >>> preset("hks", n_times=16)
    HKS(k=300, n_times=16, scaled=True)
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
    families: dict[str, Any] = {family.name: family for family in (ACD, HKS, WKS)}
    if name not in families:
        raise ConfigError(f"there is no descriptor family {name!r}; there are {', '.join(families)}")
    try:
        descriptor: Descriptor = families[name](**parameters)
    except TypeError as error:
        raise ConfigError(f"descriptor {name}: {error}") from error
    return descriptor
