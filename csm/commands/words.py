"""From what a user types to what Hydra parses: words without a key, paths with any characters, flags in any place.

Hydra has a grammar of its own, in which ``= ( ) [ ] { } ' , #`` and letters beyond ASCII mean something or are refused.
The values of keys that are paths are therefore quoted here, so that any path can be typed as the shell takes it.
"""

from __future__ import annotations

import difflib
import os
import re
from collections.abc import Iterable, Sequence
from dataclasses import fields
from pathlib import Path

from csm.errors import ConfigError

WORDS: dict[str, tuple[str, ...]] = {
    "match": ("source", "target", "out"),
    "describe": ("mesh", "out"),
    "clean": ("in", "out"),
    "bodies": ("out",),
    "sweep-report": ("folder", "out"),
    "check": ("paths",),
    "evaluate": ("checkpoint",),
    "reproduce": ("targets",),
    "bench": ("targets",),
}
"""Commands that take words without a key, with the keys that the words are for, in order."""

LISTS = ("targets", "paths")
"""Keys that take all words."""

PATHS = frozenset(
    (
        *("source", "target", "out", "mesh", "in", "checkpoint", "folder", "resume", "pretrained", "results", "store"),
        "paths",
        *("data.root", "data.split", "data.test_roots"),
    )
)
"""Keys whose values are paths, or lists of them."""

OPTIONAL_WORDS = {("match", "out"), ("sweep-report", "out")}
"""Commands and their words that may be left out; `LISTS` may be empty in any case."""

_OPTIONAL = ("experiment", "recipe")  # groups that may be left out: null for no option
_ALONE = {"-m", "--multirun", "-r", "--run", "--resolve", "--help", "-h", "--hydra-help", "--version"}
_WITH_VALUE = {
    *("--cfg", "-c", "--package", "-p", "--shell-completion", "-sc", "--config-path", "-cp", "--config-name", "-cn"),
    *("--config-dir", "-cd", "--experimental-rerun", "--info", "-i"),
}
_KEY = re.compile(r"[+~]{0,2}[A-Za-z_][\w./@:-]*")


def asks_for_help(arguments: Sequence[str]) -> bool:
    """Tell whether the arguments of a command ask for its help, whatever else they say."""
    return "--help" in arguments or "-h" in arguments


def to_overrides(command: str, arguments: Sequence[str]) -> list[str]:
    """Return the arguments of a command as Hydra takes them.

    Parameters
    ----------
    command
        Such as "match".
    arguments
        As they were typed.

    Raises
    ------
    ConfigError
        If there is a word too many, or a word where only key=value is taken.

    Examples
    --------
    >>> to_overrides("match", ["my body (1).off", "b.ply", "out=2024"])
    ["source='my body (1).off'", "target='b.ply'", "out='2024'"]
    >>> to_overrides("train", ["experiment=humans", "-m", "seed=0,1"])
    ['-m', 'experiment=humans', 'seed=0,1']
    """
    sweeping = any(argument in ("-m", "--multirun") for argument in arguments)
    words: list[str] = []
    flags: list[str] = []
    options: list[str] = []
    overrides: list[str] = []
    for before, argument in zip(("", *arguments), arguments, strict=False):
        if argument in ("-m", "--multirun"):
            flags[:] = ["-m"]
        elif _is_option(argument, before):
            options.append(argument)
        elif _is_word(argument):
            words.append(argument)
        else:
            overrides.append(_override(command, argument, sweeping))
    for group, what in (("data", "set"), ("descriptor", "descriptor")):
        _require_own_settings(overrides, group, what)
    return [*flags, *_named(command, words), *filter(None, overrides), *options]


def _is_option(argument: str, before: str) -> bool:
    """Tell whether an argument is a flag of Hydra, or the value of the flag before it."""
    if argument.startswith("-") and not Path(argument).exists():
        flag, equals, _ = argument.partition("=")
        if flag not in _ALONE and flag not in _WITH_VALUE:
            meant = argument.lstrip("-") if equals else f"{argument.lstrip('-')}=VALUE"
            raise ConfigError(f"{argument}: options are written without dashes, {meant}; --help lists them")
        return True
    return before.startswith("-") and before not in _ALONE and "=" not in before and not Path(before).exists()


def _is_word(argument: str) -> bool:
    key, equals, _ = argument.partition("=")
    if argument and os.path.lexists(os.path.expanduser(argument)):
        return True
    if argument.startswith(("~", "+")) and _KEY.fullmatch(key):
        return False
    return not (equals and _KEY.fullmatch(key))


def _named(command: str, words: Sequence[str]) -> list[str]:
    """Give the words their keys."""
    keys = WORDS.get(command, ())
    if not words:
        return []
    if keys and keys[0] in LISTS:
        each = words if keys[0] not in PATHS else [_path(word) for word in words]
        return [f"{keys[0]}=[{','.join(each)}]"]
    if len(words) > len(keys):
        extra = words[len(keys)]
        takes = f"takes {' '.join(key.upper() for key in keys)} and " if keys else "takes "
        raise ConfigError(f"csm {command} {takes}options of the form key=value, got {extra!r}{_meant(extra)}")
    return [f"{key}={_path(word)}" for key, word in zip(keys, words, strict=False)]


def _meant(word: str) -> str:
    from csm.commands.choices import options_of

    for group in ("experiment", "descriptor", "model", "data", "recipe"):
        if word in options_of(group):
            return f"; did you mean {group}={word}?"
    return ""


def _override(command: str, argument: str, sweeping: bool) -> str:
    key, equals, value = argument.partition("=")
    if key in _OPTIONAL and value in ("", "null"):
        return ""
    if key == "experiment":
        _require_experiment_of(command, value)
    if key in PATHS and value not in ("", "null"):
        return f"{key}={_path_value(value, sweeping)}"
    if items := _assignments(value):
        return f"{key}=[{','.join(map(quoted, items))}]"
    return without_null(argument) if equals else argument


def _require_experiment_of(command: str, value: str) -> None:
    """Refuse a table of several rows where one training is wanted, and the other way round."""
    from csm.commands.choices import is_table, options_of

    for name in (each.strip("'\" ") for each in value.split(",")):
        if command in ("train", "prepare") and is_table(name):
            raise ConfigError(f"experiment={name} is a table of several trainings: csm matrix experiment={name}")
        if command == "matrix" and not is_table(name) and name in options_of("experiment"):
            raise ConfigError(
                f"experiment={name} is one training and no table: csm train experiment={name}; the tables are "
                f"{', '.join(options_of('experiment', command))}"
            )


def _require_own_settings(overrides: Sequence[str], group: str, what: str) -> None:
    """Refuse another choice than an experiment's where it has settings for its own one that are left as they are."""
    from csm.commands.choices import own_settings

    typed = {key.lstrip("+~"): value for key, _, value in (text.partition("=") for text in overrides)}
    if not {"experiment", group} <= set(typed):
        return
    own, settings = own_settings(typed["experiment"], group)
    known = _parameters(typed[group]) if group == "descriptor" else ()
    left = [f"{group}.{key}" for key in settings if f"{group}.{key}" not in typed and key not in known]
    if own not in (None, typed[group]) and left:
        raise ConfigError(
            f"experiment={typed['experiment']} sets {' and '.join(left)} for {group}={own}, and {group}={typed[group]} "
            f"is another {what}; add {' '.join(f'~{key}' for key in left)}, or give your own"
        )


def _parameters(descriptor: str) -> tuple[str, ...]:
    """Return the names of the parameters of a preset; none of what is no preset, such as a list of them for a sweep."""
    from csm.descriptors.presets import preset

    try:
        return tuple(field.name for field in fields(preset(descriptor)))
    except ConfigError:
        return ()


def _assignments(value: str) -> list[str]:
    """Return the items of a list of overrides, in which = means nothing to Hydra without quotes; none of other values.

    Examples
    --------
    >>> _assignments("[a=1, b=[2,[3]]]"), _assignments("[a=1],[a=2]"), _assignments("[1,2]")
    (['a=1', 'b=[2,[3]]'], [], [])
    """
    if not (value.startswith("[") and value.endswith("]")) or set(value) & set("'\"{}"):
        return []
    items, depth = [""], 0
    for sign in value[1:-1]:
        depth += (sign in "[(") - (sign in "])")
        if depth < 0:
            return []
        if sign == "," and depth == 0:
            items.append("")
        else:
            items[-1] += sign
    found = [item.strip() for item in items]
    return found if depth == 0 and all(re.match(r"[^\[\]()=]+=", item) for item in found) else []


def _path_value(value: str, sweeping: bool) -> str:
    if _is_quoted(value) or (value.startswith("${") and not os.path.lexists(value)):
        return value
    whole = os.path.expanduser(value)
    if os.path.lexists(whole):
        return _path(value)
    if value.startswith("[") and value.endswith("]"):
        return f"[{','.join(_each(value[1:-1]))}]"
    if sweeping and "," in value:
        return ",".join(_each(value))
    return quoted(whole)


def _path(word: str) -> str:
    """Return a path in quotes; where a file has "${" in its name, that is no reference."""
    whole = os.path.expanduser(word)
    return quoted(whole).replace("${", r"\${") if os.path.lexists(whole) else quoted(whole)


def _each(values: str) -> Iterable[str]:
    return (
        v if _is_quoted(v) or v == "null" else quoted(os.path.expanduser(v))
        for v in map(str.strip, values.split(","))
        if v
    )


def _is_quoted(value: str) -> bool:
    return len(value) > 1 and value[0] == value[-1] and value[0] in "'\""


def quoted(value: str) -> str:
    r"""Return a value in quotes that Hydra takes off again, whatever characters it has.

    Examples
    --------
    >>> print(quoted("it's=[1], ok"))
    'it\'s=[1], ok'
    """
    escaped = re.sub(r"(\\*)'", lambda found: found[1] * 2 + r"\'", value)
    end = re.search(r"\\+$", escaped)
    return f"'{escaped}{end[0] if end else ''}'"


def without_null(argument: str) -> str:
    """Return ``logger=none`` for ``logger=null``, which Hydra refuses for a group; other arguments stay.

    Examples
    --------
    >>> without_null("logger=null"), without_null("resume=null")
    ('logger=none', 'resume=null')
    """
    from csm.commands.choices import config_folder

    group, equals, value = argument.partition("=")
    has_none = group.isidentifier() and (config_folder() / group / "none.yaml").is_file()
    return f"{group}=none" if has_none and value in ("null", "") and equals else argument


def nearest_names(name: str, names: Iterable[str]) -> str:
    """Return a question that offers the names most like a misspelt one, or an empty string.

    Examples
    --------
    >>> nearest_names("adc", ["acd", "hks"])
    '; did you mean acd?'
    """
    known = list(names)
    begun = [one for one in known if len(name) > 2 and one.startswith(name) and "." not in one]
    close = list(dict.fromkeys([*begun, *difflib.get_close_matches(name, known, n=3, cutoff=0.6)]))[:3]
    return f"; did you mean {' or '.join(close)}?" if close else ""
