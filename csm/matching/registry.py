"""The matchers by name, as ``matching=`` of the commands and `csm.evaluate` ask for them."""

from __future__ import annotations

from collections.abc import Sequence

from csm._places import load
from csm.errors import ConfigError
from csm.matching.base import Matcher

PLACES = {
    "nearest": "nearest:Nearest",
    "argmax": "classifier:Argmax",
}
"""Name -> file and class, whose parameters have defaults.  A new matcher is one file and one line here."""

MATCHERS: dict[str, type[Matcher]] = {name: load(f"csm.matching.{place}") for name, place in PLACES.items()}
"""The classes by name."""


def matcher(name: str | Matcher) -> Matcher:
    """Return a matcher as it is given, or the one of a name with its default parameters.

    Raises
    ------
    ConfigError
        If there is no matcher of that name.

    Examples
    --------
    >>> matcher("nearest")
    Nearest()
    """
    if isinstance(name, Matcher):
        return name
    if not isinstance(name, str) or name not in MATCHERS:
        shown = repr(name) if isinstance(name, str) else f"a {type(name).__name__}"
        raise ConfigError(f"matching={shown}; wanted {' or '.join(MATCHERS)}")
    return MATCHERS[name]()


def matchers(names: Sequence[str | Matcher]) -> list[Matcher]:
    """Return several matchers; ConfigError if one is unknown or there is none."""
    if not names:
        raise ConfigError(f"matching: wanted one or more of {', '.join(MATCHERS)}")
    return [matcher(name) for name in names]
