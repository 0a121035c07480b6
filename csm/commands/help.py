"""``csm COMMAND --help``: options and groups in words, read from the yaml files."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, field

from csm.commands.choices import BENCHES, config_folder, options_of
from csm.commands.words import LISTS, OPTIONAL_WORDS, WORDS
from csm.reproduction.registry import STUDIES, explained, listing
from csm.reproduction.registry import options_of as options_of_study

_OPTION = re.compile(r"(?P<key>\w+):\s*(?P<value>[^#]*?)\s*(?:#\s*(?P<words>.*))?")
_ITEM = re.compile(
    r"\s+- (?:(?:override )?/?(?P<group>[\w/]+): (?P<choice>[\w/]+)|(?P<file>\w+))\s*(?:#\s*(?P<words>.*))?"
)
_WIDTH = 110

SETTINGS = {
    "train": {
        "data.root=FOLDER": "of the meshes, or of the data sets below which the set is; the built-in humans need none",
        "data.split=NAME": "which shapes train, validate and test: one of the set's splits, or a json file of your own",
        "data.holdout=10": "validate on this many training shapes, the last ones, which are then not fitted",
        "data.also=[remeshed_5000]": "more training shapes: other triangles, cut_30 (percent), bodies.npz, or humans",
        "data.test=[remeshed_5000]": "sets to test on, by their names; data.test_roots=[FOLDER] with data=folder",
        "data.test_forms=[uneven_8000]": "also test on the first of these sets with other triangles",
        "data.basis_k=128": "eigenpairs that are kept of each shape",
        "trainer.max_epochs=50": "how often all training shapes are gone through",
        "trainer.max_time=00:01:00:00": "days:hours:minutes:seconds after which it ends, whatever the epoch",
        "trainer.check_val_every_n_epoch=5": "epochs from one validation, and its printed numbers, to the next",
    },
    "evaluate": {
        "data.root=FOLDER": "of the meshes, or of the data sets below which the set is; the built-in humans need none",
        "data.test=[remeshed_5000]": "sets to test on, by their names; data.test_roots=[FOLDER] with data=folder",
        "data.test_forms=[uneven_8000]": "also test on the first of these sets with other triangles",
    },
}
"""Commands -> settings of groups with several options that are changed most, each with an example, and what they do."""

_SHARED = ("store", "device", "workers")

IDLE = {
    "bodies": ("store", "device"),
    "check": _SHARED,
    "clean": _SHARED,
    "describe": _SHARED,
    "doctor": ("device", "workers"),
    "sweep-report": _SHARED,
}
"""Commands -> the shared options that change nothing in them; they are taken, so that scripts can give them to all."""


@dataclass
class Page:
    """What the yaml of a command says: its purpose, options (key, default, words) and groups (name, default, words)."""

    purpose: list[str] = field(default_factory=list)
    options: list[tuple[str, str, str]] = field(default_factory=list)
    groups: list[tuple[str, str, str]] = field(default_factory=list)


def read_page(config_name: str) -> Page:
    """Read the yaml of a command, and those that it builds on, without the options that change nothing in it."""
    page = Page()
    _read(config_name, page)
    page.options = [option for option in page.options if option[0] not in IDLE.get(config_name, ())]
    return page


def _read(config_name: str, page: Page) -> None:
    text = (config_folder() / f"{config_name}.yaml").read_text(encoding="utf-8")
    section, began = "", False
    for line in text.splitlines():
        if line.startswith("#") and not began:
            if not page.options:
                page.purpose.append(line.lstrip("# "))
            continue
        began = True
        if not line.startswith((" ", "#")) and line.strip():
            section = line.partition(":")[0]
        item = _ITEM.fullmatch(line) if section == "defaults" else None
        if item and item["group"]:
            page.groups.append((item["group"], item["choice"], item["words"] or ""))
        elif item and item["file"] not in ("_self_", "studies"):
            _inherit(item["file"], page)
        option = _OPTION.fullmatch(line)
        if option and section not in ("defaults", "hydra") and option["value"]:
            page.options.append((option["key"], option["value"], option["words"] or ""))


def _inherit(config_name: str, page: Page) -> None:
    above = read_page(config_name)
    page.options += above.options
    page.groups += above.groups


def help_text(command: str, arguments: Sequence[str] = ()) -> str:
    """Return the help of a command, such as "match"; its yaml has the same name.

    Parameters
    ----------
    command
        Its name.
    arguments
        What else was typed: the studies among it are explained.
    """
    page = read_page(command)
    options = {option[0]: option for option in page.options}.values()
    own = sorted(options, key=lambda option: option[0] in {key for key, *_ in read_page("common").options})
    words = " ".join(_word(command, key) for key in WORDS.get(command, ()))
    lines = [f"usage: csm {command} {words} [key=value ...]".replace("  ", " "), ""]
    lines += [*textwrap.wrap(" ".join(page.purpose), _WIDTH), ""]
    named = studies_of(command)
    studies = [named[word] for word in arguments if word in named]
    if command == "reproduce" and not studies:
        lines += ["studies, each with options of its own (csm reproduce table1 --help):", listing(), ""]
    for study in studies:
        known, meaning = options_of_study(study), explained(study)
        rows = [(f"{study}.{key}={_shown(value)}", meaning[key]) for key, value in known.items()]
        lines += [f"options of {study}, with their defaults:", *_table(rows), ""]
    lines += ["options, with their defaults:", *_table([(f"{key}={value}", text) for key, value, text in own])]
    for group, choice, _ in page.groups:
        if group.startswith("hydra"):
            continue
        only = options_of(group) == [choice]  # the settings of others are in SETTINGS, or too many
        rows = [(f"{group}.{key}={value}", text) for key, value, text in settings_of(group, choice) if only]
        lines += ["", f"settings of the group {group}:", *_table(rows)] if rows else []
    if command in SETTINGS:
        lines += ["", "settings of data and trainer that are changed most (these are examples):"]
        lines += _table(list(SETTINGS[command].items()))
    groups = [row for row in page.groups if len(options_of(row[0])) > 1 and not row[0].startswith("hydra")]
    if groups:
        lines += ["", "groups, of which one option each is chosen as GROUP=OPTION:"]
        lines += _table([(group, _choices(command, group, choice, text)) for group, choice, text in groups])
        lines += ["", "An option has settings of its own, such as descriptor.k=20; --cfg job shows all of them."]
    lines += [
        "",
        "--cfg job shows the resolved configuration and does nothing; -m key=a,b,c runs every combination;",
        "debug=true shows the traceback of an error.",
    ]
    return "\n".join(lines)


def _word(command: str, key: str) -> str:
    """Return how the usage of a command shows a word: in brackets where it may be left out."""
    word = f"{key.upper()} ..." if key in LISTS else key.upper()
    return f"[{word}]" if key in LISTS or (command, key) in OPTIONAL_WORDS else word


def studies_of(command: str) -> dict[str, str]:
    """Return word -> study of the words that a command takes for studies; nothing for most commands.

    Examples
    --------
    >>> studies_of("bench")["descriptors"], studies_of("match")
    ('table2', {})
    """
    return dict(BENCHES) if command == "bench" else {name: name for name in STUDIES} if command == "reproduce" else {}


def _shown(value: object) -> str:
    """Return a default as it is typed."""
    text = "null" if value is None else str(value).lower() if isinstance(value, bool) else str(value)
    return text.replace("'", "").replace(", ", ",")


def settings_of(group: str, choice: str) -> list[tuple[str, str, str]]:
    """Return the settings in the yaml of an option of a group (key, default, words); none without such a file."""
    file = config_folder() / group / f"{choice}.yaml"
    lines = file.read_text(encoding="utf-8").splitlines() if file.is_file() else []
    found = (_OPTION.fullmatch(line) for line in lines)
    return [(option["key"], option["value"], option["words"] or "") for option in found if option]


def _choices(command: str, group: str, choice: str, text: str) -> str:
    names = [f"{name} (default)" if name == choice else name for name in options_of(group, command)]
    return ", ".join(names) + (f": {text}" if text else "")


def _table(rows: list[tuple[str, str]]) -> list[str]:
    width = min(max(len(left) for left, _ in rows), 34)
    lines: list[str] = []
    for left, right in rows:
        wrapped = textwrap.wrap(right, _WIDTH - width - 4) or [""]
        if len(left) > width:
            lines.append(f"  {left}")
            left = ""
        lines.append(f"  {left:<{width}}  {wrapped[0]}".rstrip())
        lines += [f"{'':{width + 4}}{line}" for line in wrapped[1:]]
    return lines
