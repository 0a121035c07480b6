"""``csm completion SHELL``: commands, keys and what can be chosen of a group, completed by bash, zsh or fish.

The shell asks for every word anew, so nothing is loaded here but the yaml files and the registries of names.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from csm.commands.choices import options_of
from csm.commands.help import SETTINGS, Page, read_page, settings_of, studies_of
from csm.commands.main import COMMANDS, COMPLETION
from csm.commands.words import PATHS

_BASH = """\
_csm() {
    local IFS=$'\\n' line="${COMP_LINE:0:COMP_POINT}"
    local word="${line##* }"
    COMPREPLY=( $("${COMP_WORDS[0]}" completion words "$line" 2>/dev/null) )
    if [[ "$word" == *=* && "$COMP_WORDBREAKS" == *=* ]]; then
        COMPREPLY=( "${COMPREPLY[@]#"${word%%=*}="}" )  # what stands before = is a word of its own to bash
    fi
    [[ "${COMPREPLY[0]}" == *= ]] && compopt -o nospace
    return 0
}
complete -o bashdefault -o default -F _csm csm
"""

_ZSH = """\
#compdef csm
_csm() {
    local -a found
    found=("${(@f)$("${words[1]}" completion words "${(j: :)words[1,CURRENT]}" 2>/dev/null)}")
    if [[ -n "$found" ]]; then
        compadd -S '' -- $found
    else
        compset -P '*='
        _files
    fi
}
compdef _csm csm
"""

_FISH = """\
complete --command csm --arguments '(csm completion words (commandline -cp | string collect))'
"""

SCRIPTS = {"bash": _BASH, "zsh": _ZSH, "fish": _FISH}
"""Shell -> what it runs to complete the words of csm."""


def run(arguments: list[str]) -> str | None:
    """Return what ``csm completion ARGUMENTS`` prints; None if these are not understood.

    Parameters
    ----------
    arguments
        A shell, or "words" and the line up to the cursor, for which the shell is answered with a word per line.
    """
    match arguments:
        case [shell] if shell in SCRIPTS:
            return SCRIPTS[shell]
        case ["words", line]:
            return "".join(f"{word}\n" for word in candidates(line))
    return None


def candidates(line: str) -> list[str]:
    """Return the words that the last word of a command line can become.

    None where that is a path, which the shell completes itself.

    Parameters
    ----------
    line
        The command line up to the cursor.

    Examples
    --------
    >>> candidates("csm mat")
    ['matrix', 'match']
    >>> candidates("csm match a.off b.off refine=j")
    ['refine=joint']
    """
    line = line.lstrip()
    _, *before, word = line.split(" ") if " " in line else ["", line]
    before = [part for part in before if part]
    if not before:
        return [name for name in (*COMMANDS, COMPLETION) if name.startswith(word)]
    if before == [COMPLETION]:
        return [shell for shell in SCRIPTS if shell.startswith(word)]
    if before[0] not in COMMANDS or word.startswith("-"):
        return []
    key, equals, _ = word.partition("=")
    page = read_page(before[0])
    found = (
        _values(before[0], key, page)
        if equals
        else [*studies_of(before[0]), *(f"{name}=" for name in _keys(before[0], page))]
    )
    return [candidate for candidate in found if candidate.startswith(word)]


def _keys(command: str, page: Page) -> list[str]:
    """Return the keys that a command takes: its options, its groups, and their settings."""
    keys = [key for key, *_ in page.options]
    for group, choice, _ in page.groups:
        keys += [group] if len(options_of(group)) > 1 else []
        keys += [f"{group}.{key}" for key, *_ in settings_of(group, choice)]
    keys += [example.partition("=")[0] for example in SETTINGS.get(command, ())]
    return list(dict.fromkeys(keys))


def _values(command: str, key: str, page: Page) -> list[str]:
    """Return KEY=VALUE for all values that are known of a key; none of a path."""
    if key in PATHS:
        return []
    if any(key == group for group, *_ in page.groups):
        return [f"{key}={name}" for name in options_of(key, command)]
    if key in _NAMES:
        return [f"{key}={name}" for name in _NAMES[key]()]
    if any(key == option and value in ("true", "false") for option, value, _ in page.options):
        return [f"{key}=true", f"{key}=false"]
    return []


def _matchers() -> list[str]:
    from csm.matching.registry import MATCHERS

    return list(MATCHERS)


def _refiners() -> list[str]:
    from csm.matching.refinement.registry import NONE, REFINERS

    return ["auto", NONE, *REFINERS]


def _shipped() -> list[str]:
    from csm.matching.shipped import shipped_models

    return ["auto", *shipped_models()]


_NAMES: Mapping[str, Callable[[], list[str]]] = {"matching": _matchers, "refine": _refiners, "model": _shipped}
"""Keys, which are no groups, -> the names that they take."""
