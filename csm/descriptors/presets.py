"""The registry: every named setting of every descriptor, one line each.

A new family needs a file with its class in this folder, and one line here.  `from_parameters` then knows it by its
`name`, and `csm.descriptors` has the class, so that a configuration can name it as ``csm.descriptors.NAME``.
"""

from __future__ import annotations

from dataclasses import fields, replace
from functools import cache, partial
from typing import TYPE_CHECKING, Any

from csm._places import Loaded, load
from csm.errors import ConfigError

if TYPE_CHECKING:
    from csm.descriptors.base import Descriptor

SETTINGS: dict[str, tuple[str, dict[str, Any]]] = {
    "acd": ("acd:ACD", {}),
    "acd_paper": ("acd:ACD.paper", {}),
    "acd_release": ("acd:ACD.release", {}),
    "acd_release_frame": ("acd:ACD.release", {"frame": "released", "sweeps": 10}),
    "acd_isotropic": ("acd:ACD.isotropic", {}),
    "acd_two_bands": ("acd:ACD.two_bands", {}),
    "hks": ("hks:HKS", {}),
    "hks_diffusionnet": ("hks:HKS", {"k": 128, "n_times": 16, "scaled": False, "first": 0.01, "last": 1.0}),
    "wks": ("wks:WKS", {}),
    "wks_functional_map": ("wks:WKS", {"variant": "functional_map"}),
    "shot": ("shot:SHOT", {}),
    "dep": ("dep:DEP", {}),
    "amks": ("amks:AMKS", {}),
    "smwd": ("smwd:SMWD", {}),
    "smwd_mexican": ("smwd:SMWD", {"variant": "mexican"}),
    "weds": ("weds:WEDS", {}),
    "wft": ("wft:WFT", {}),
    "awft": ("awft:AWFT", {}),
    "asmwd": ("asmwd:ASMWD", {}),
    "add": ("add:ADD", {}),
    "geometry_vectors": ("geometry_vectors:GeometryVectors", {}),
    "gps": ("gps:GPS", {}),
    "lps": ("lps:LPS", {}),
    "constant": ("constant:Constant", {}),
    "xyz": ("coordinates:Coordinates", {}),
}
"""Name -> file and class (or what else makes the descriptor), and the parameters that differ from its defaults.

"acd_release_frame" reproduces the authors' output with their frame, which depends on the world's axes.
"""


def _made(name: str) -> Descriptor:
    place, changes = SETTINGS[name]
    found: Descriptor = load(f"csm.descriptors.{place}")(**changes)
    return found


PRESETS: Loaded[Descriptor] = Loaded({name: partial(_made, name) for name in SETTINGS})
"""The named settings as descriptors."""

if TYPE_CHECKING:
    FAMILIES: dict[str, type[Descriptor]]
    """The classes of descriptors by `Descriptor.name`."""


def __getattr__(name: str) -> Any:
    if name == "FAMILIES":
        return families()
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


@cache
def families() -> dict[str, type[Descriptor]]:
    """Return the classes of descriptors by `Descriptor.name`, which is also `FAMILIES`; all of them are imported."""
    classes_ = [*(type(each) for each in PRESETS.values()), load("csm.descriptors.stack:Stack")]
    return {each.name: each for each in classes_}


def classes() -> dict[str, tuple[str, ...]]:
    """Return the modules of the families, each with the names of its classes, without importing them.

    Examples
    --------
    >>> classes()["csm.descriptors.acd"]
    ('ACD',)
    """
    found: dict[str, tuple[str, ...]] = {}
    for place, _ in SETTINGS.values():
        module, _, name = place.partition(":")
        known = found.get(f"csm.descriptors.{module}", ())
        found[f"csm.descriptors.{module}"] = tuple(dict.fromkeys((*known, name.partition(".")[0])))
    return found


def preset(name: str, **overrides: Any) -> Descriptor:
    """Return the descriptor with a named setting, with some parameters replaced.

    Parameters
    ----------
    name
        A key of `PRESETS`, such as "acd" (csm's own settings), "acd_paper", "hks", "wks" or "shot".
    **overrides
        Parameters of the descriptor that shall have other values than in the setting.

    Returns
    -------
    Descriptor
        Call it on a `Mesh` to get `Features`: one row of numbers per vertex.

    Raises
    ------
    ConfigError
        If the name or a parameter is unknown, or a value is out of range.

    Examples
    --------
    >>> preset("hks", n_times=16)
    HKS(k=300, n_times=16, scaled=True, first=None, last=None)

    >>> import csm
    >>> preset("acd")(csm.read_mesh("tr_reg_000.off"))  # doctest: +SKIP
    Features(6890 vertices, 640 columns: theta=0.000 K=11 T0 ... theta=2.985 K=8 T7)
    """
    if not isinstance(name, str) or name not in PRESETS:
        raise ConfigError(f"there is no descriptor {name!r}; there are {', '.join(PRESETS)}")
    descriptor = PRESETS[name]
    known = [field.name for field in fields(descriptor)]
    unknown = [key for key in overrides if key not in known]
    if unknown:
        raise ConfigError(f"{name} has no parameter {', '.join(unknown)}; it has {', '.join(known)}")
    return replace(descriptor, **overrides)


def preset_name(descriptor: Descriptor) -> str | None:
    """Return the key of `PRESETS` that has a descriptor's parameters, or None.

    Examples
    --------
    >>> preset_name(preset("acd_paper")), preset_name(preset("acd_paper", k=12))
    ('acd_paper', None)
    """
    return next((name for name, setting in PRESETS.items() if setting == descriptor), None)


def from_parameters(name: str, *, version: int = 1, **parameters: Any) -> Descriptor:
    """Return the descriptor of a record, as `csm.descriptors.base.record` makes it for checkpoints and the store.

    Parameters
    ----------
    name
        Of the family.
    version
        Of the family's formula, when the record was made.
    **parameters
        All parameters of the family; those of `Descriptor.added` may be missing and then have their neutral value.

    Raises
    ------
    ConfigError
        If the family or a parameter is unknown, a parameter is missing, a value is out of range, or the formula has
        another version by now.

    Examples
    --------
    >>> from_parameters("hks", **preset("hks", n_times=16).parameters()) == preset("hks", n_times=16)
    True
    """
    if name not in families():
        raise ConfigError(f"there is no descriptor family {name!r}; there are {', '.join(families())}")
    family = families()[name]
    if version != family.version:
        raise ConfigError(
            f"descriptor {name}: the record is of version {version}, but this csm computes version {family.version}; "
            "prepare or train anew, or use the csm that the record was made with"
        )
    given = {**family.added, **parameters}
    known = [field.name for field in fields(family)]
    unknown, missing = [key for key in given if key not in known], [key for key in known if key not in given]
    if unknown or missing:
        raise ConfigError(
            f"descriptor {name}: the record has {', '.join(given) or 'no parameters'}, but wanted are "
            f"{', '.join(known) or 'none'} (unknown: {', '.join(unknown) or 'none'}; "
            f"missing: {', '.join(missing) or 'none'})"
        )
    if name == "stack":
        given = {"parts": {key: from_parameters(**part) for key, part in given["parts"].items()}}
    return family(**given)
