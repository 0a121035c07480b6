"""The refiners by name, as ``refine=`` of the commands and of `csm.match` asks for them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from csm._places import Loaded, load, shown
from csm.errors import ConfigError
from csm.matching.base import Matcher
from csm.matching.refinement.base import Refined, Refiner

PLACES = {
    "multistart": "multistart:Multistart",
    "trusting": "trusting:Trusting",
    "joint": "joint:Joint",
    "zoomout": "zoomout:ZoomOut",
    "bijective": "zoomout:Bijective",
    "icp": "zoomout:ICP",
}
"""Name -> file and class, whose parameters have defaults.  A new refiner is one file and one line here."""

REFINERS: Loaded[type[Refiner]] = Loaded(
    {name: partial(load, f"csm.matching.refinement.{place}") for name, place in PLACES.items()}
)
"""The classes by name."""

NONE = "none"
"""The name that stands for no refinement."""


def refiner(name: str | Refiner | None) -> Refiner | None:
    """Return a refiner as it is given, the one of a name with its default parameters, or None for "none".

    Raises
    ------
    ConfigError
        If there is no refiner of that name.

    Examples
    --------
    >>> refiner("zoomout")
    ZoomOut(first=20, last=200, step=10, samples=2500)
    >>> refiner("none") is None
    True
    """
    if name is None or isinstance(name, Refiner):
        return name
    if name == NONE:
        return None
    if not isinstance(name, str) or name not in REFINERS:
        names = f"{NONE}, {', '.join(list(REFINERS)[:-1])} or {list(REFINERS)[-1]}"
        raise ConfigError(f"refine={shown(name)}; wanted {names}; a match of two meshes also takes auto")
    return REFINERS[name]()


def refined(matchers: Sequence[Matcher], refiners: Sequence[str | Refiner | None]) -> list[Matcher]:
    """Return every matcher followed by every refiner, itself for "none".

    Raises
    ------
    ConfigError
        If a refiner is unknown or there is none.
    """
    if not refiners:
        raise ConfigError(f"refine: wanted one or more of {NONE}, {', '.join(REFINERS)}")
    chosen = [refiner(name) for name in refiners]
    return [matcher if rule is None else Refined(matcher, rule) for matcher in matchers for rule in chosen]
