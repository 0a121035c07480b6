"""The matchers by name, as ``matching=`` of the commands and `csm.evaluate` ask for them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from csm._places import Loaded, load, shown
from csm.errors import ConfigError
from csm.matching.base import Matcher
from csm.matching.refinement.base import Refined, Refiner
from csm.matching.refinement.registry import NONE, refined, refiner

PLACES = {
    "nearest": "nearest:Nearest",
    "argmax": "classifier:Argmax",
}
"""Name -> file and class, whose parameters have defaults.  A new matcher is one file and one line here."""

MATCHERS: Loaded[type[Matcher]] = Loaded(
    {name: partial(load, f"csm.matching.{place}") for name, place in PLACES.items()}
)
"""The classes by name."""


def matcher(name: str | Matcher) -> Matcher:
    """Return a matcher as it is given, or the one of a name with its default parameters.

    The name of a matcher followed by a refiner has a plus sign, such as "nearest+multistart".

    Raises
    ------
    ConfigError
        If there is no matcher or refiner of that name.

    Examples
    --------
    >>> matcher("nearest")
    Nearest()
    >>> matcher("nearest+joint").name
    'nearest+joint'
    """
    if isinstance(name, Matcher):
        return name
    if isinstance(name, str) and "+" in name:
        first, _, second = name.partition("+")
        rule, improver = matcher(first), refiner(second)
        return rule if improver is None else Refined(rule, improver)
    if not isinstance(name, str) or name not in MATCHERS:
        raise ConfigError(f"matching={shown(name)}; wanted {' or '.join(MATCHERS)}")
    return MATCHERS[name]()


def matchers(names: Sequence[str | Matcher], refine: Sequence[str | Refiner | None] = (NONE,)) -> list[Matcher]:
    """Return several matchers, each followed by each of the refiners; ConfigError if one is unknown or there is none.

    Examples
    --------
    >>> [each.name for each in matchers(["nearest"], ["none", "icp"])]
    ['nearest', 'nearest+icp']
    """
    if not names:
        raise ConfigError(f"matching: wanted one or more of {', '.join(MATCHERS)}")
    return refined([matcher(name) for name in names], refine)
