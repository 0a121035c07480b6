"""Pages of the site that are made from the code: the front page, commands, choices and the interface from Python.

mkdocs calls `on_files` (see mkdocs.yml); the functions below it need nothing but csm.
"""

from __future__ import annotations

import importlib
import pkgutil
import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import csm
from csm.commands.choices import config_folder, options_of
from csm.commands.help import read_page
from csm.commands.main import COMMANDS

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig
    from mkdocs.structure.files import Files

ROOT = Path(__file__).parents[2]
ROOMS = [
    "mesh",
    "operators",
    "descriptors",
    "data",
    "networks",
    "learning",
    "matching",
    "evaluation",
    "viewer",
    "experiments",
    "reproduction",
]


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the made pages to those of the folder."""
    from mkdocs.structure.files import File

    for name, text in made_pages().items():
        files.append(File.generated(config, name, content=text))
    return files


def on_page_markdown(markdown: str, **_: object) -> str:
    """Let links out of the folder stay on the site."""
    return markdown.replace("](../README.md)", "](index.md)").replace("](../CONTRIBUTING.md)", "](contributing.md)")


def made_pages() -> dict[str, str]:
    """Return file name -> markdown of every made page."""
    return {
        "index.md": front_page(),
        "contributing.md": _moved((ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")),
        "changelog.md": _moved((ROOT / "CHANGELOG.md").read_text(encoding="utf-8")),
        "reference/commands.md": commands_page(),
        "reference/choices.md": choices_page(),
        "reference/python.md": python_page(),
        "reference/interop.md": "# csm.interop\n\n::: csm.interop\n    options:\n      heading_level: 2\n",
        **{f"reference/{room}.md": room_page(room) for room in ROOMS},
    }


def front_page() -> str:
    """Return the README with its links as they are on the site."""
    return _moved((ROOT / "README.md").read_text(encoding="utf-8"))


def _moved(text: str) -> str:
    """Let the links of a page of the repository's root lead to where its targets are on the site, or to no place."""
    text = text.replace("](docs/", "](").replace("](CONTRIBUTING.md)", "](contributing.md)")
    return re.sub(r"\[([^\]]*)\]\((?:LICENSE|CITATION\.cff|csm/[^)]*|results/[^)]*|benchmarks/[^)]*)\)", r"`\1`", text)


def commands_page() -> str:
    """Return every command with its options, their defaults and what they mean."""
    parts = ["# Commands", "", "`csm COMMAND --help` prints the same. Options are given as `key=value`.", ""]
    for name, purpose in COMMANDS.items():
        page = read_page(name)
        parts += [f"## csm {name}", "", f"{purpose[0].upper()}{purpose[1:]}.", "", " ".join(page.purpose), ""]
        if page.groups:
            shown = (group for group in page.groups if not group[0].startswith("hydra/"))
            rows = ((f"`{key}`", f"`{value}`", words) for key, value, words in shown)
            parts += [*_table(("what can be chosen", "default", "meaning"), rows), ""]
        rows = ((f"`{key}`", f"`{value}`", words) for key, value, words in page.options)
        parts += [*_table(("option", "default", "meaning"), rows), ""]
    return "\n".join(parts)


def choices_page() -> str:
    """Return every group with its options and the first comment of their yaml files."""
    parts = [
        "# What can be chosen",
        "",
        "Each group is given as `group=option`, also to `csm COMMAND -m group=a,b`.",
        "",
    ]
    groups = sorted(path.name for path in config_folder().iterdir() if path.is_dir() and path.name != "hydra")
    for group in sorted({*groups, "data", "descriptor", "model"}):
        rows = ((f"`{option}`", _purpose(group, option)) for option in options_of(group))
        parts += [f"## {group}", "", *_table(("option", "what it is"), rows), ""]
    return "\n".join(parts)


def _purpose(group: str, option: str) -> str:
    """Return what a yaml file says of itself, or what csm's registry holds under the name."""
    file = config_folder() / group / f"{option}.yaml"
    if file.is_file():
        lines = (line.lstrip("# ") for line in file.read_text(encoding="utf-8").splitlines() if line.startswith("#"))
        return " ".join(line for line in lines if not line.startswith("@package"))
    if group == "descriptor":
        return f"`{csm.preset(option)!r}`"
    if group == "model":
        from csm.networks.registry import MODELS

        return ", ".join(f"`{key}={value}`" for key, value in MODELS.get(option, {"name": option}).items())
    from csm.data.registry import DATA_SETS

    return _first_line(importlib.import_module(DATA_SETS[option]).__doc__)


def python_page() -> str:
    """Return the names in `csm` itself, each with the first line of its documentation and a link to the rest."""
    things = {name: getattr(csm, name) for name in sorted(dir(csm)) if not name.startswith("_")}
    rows = (
        (f"[`csm.{name}`][{thing.__module__}.{thing.__qualname__}]", _first_line(thing.__doc__))
        for name, thing in things.items()
        if callable(thing)
    )
    return "\n".join(["# The names in csm", "", *_table(("name", "what it is"), rows), ""])


def room_page(room: str) -> str:
    """Return the public modules of a room, in the order of their names."""
    package = importlib.import_module(f"csm.{room}")
    parts = [f"# csm.{room}", "", str(package.__doc__), ""]
    for name in _modules(f"csm.{room}", list(package.__path__)):
        parts += [f"::: {name}", "    options:", "      heading_level: 2", ""]
    return "\n".join(parts)


def _modules(package: str, places: list[str]) -> Iterator[str]:
    for found in pkgutil.iter_modules(places, f"{package}."):
        if found.name.rpartition(".")[2].startswith("_"):
            continue
        yield found.name
        if found.ispkg:
            yield from _modules(found.name, [str(Path(place) / found.name.rpartition(".")[2]) for place in places])


def _first_line(text: str | None) -> str:
    return (text or "").strip().splitlines()[0]


def _table(head: tuple[str, ...], rows: Iterator[tuple[str, ...]]) -> list[str]:
    lines = [f"| {' | '.join(head)} |", "|---" * len(head) + "|"]
    return lines + [f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in row)} |" for row in rows]
