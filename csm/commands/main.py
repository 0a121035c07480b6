"""The `csm` program: one word chooses the command, the rest is Hydra's."""

from __future__ import annotations

import importlib
import sys

from csm import __version__

COMMANDS = {
    "train": "train a network on one set and test it on others",
    "evaluate": "test a checkpoint on other sets or resolutions",
    "matrix": "train once per training set, evaluate on every test set, resumable cell by cell",
    "match": "match two meshes of your own",
    "describe": "compute a descriptor of one mesh",
    "prepare": "fill, check or prune the store of bases and descriptors",
    "check": "list what is wrong with the meshes of a folder",
    "reproduce": "make tables and figures of the paper again from data",
    "bench": "measure how long the descriptors or the networks take",
}

WORDS = {"check": "folder", "reproduce": "targets", "bench": "targets"}
"""Commands that take words without a key, with the option that the words are for."""

_LISTS = {"targets"}
_ALONE = {"-m", "--multirun", "-r", "--run", "--resolve"}  # options of Hydra that no value follows


def usage() -> str:
    """Return the text of ``csm --help``."""
    rows = "\n".join(f"  {name:<10}{text}" for name, text in COMMANDS.items())
    return (
        f"csm {__version__}: dense correspondence between deformable meshes with spectral descriptors\n\n"
        f"usage: csm COMMAND [key=value ...]\n\n{rows}\n\n"
        "csm COMMAND --help lists the options, --cfg job shows the resolved configuration,\n"
        "-m key=a,b,c runs every combination. An example that needs no data: csm train experiment=demo"
    )


def main() -> None:
    """Run ``csm``; exit status 2 after an error that the user can mend."""
    arguments = sys.argv[1:]
    if not arguments or arguments[0] in ("-h", "--help", "help"):
        print(usage())
        return
    if arguments[0] in ("-V", "--version"):
        print(__version__)
        return
    if arguments[0] not in COMMANDS:
        print(f"csm: there is no command {arguments[0]!r}; csm --help lists them", file=sys.stderr)
        sys.exit(2)
    sys.argv = [f"csm {arguments[0]}", *_named(*arguments)]
    importlib.import_module(f"csm.commands.{arguments[0]}").main()


def _named(command: str, *arguments: str) -> list[str]:
    """Let ``csm check FOLDER ...`` stand for ``csm check folder=FOLDER ...``, and so on for `WORDS`.

    Examples
    --------
    >>> _named("reproduce", "table1", "seed=1", "figure4", "--cfg", "job")
    ['targets=[table1,figure4]', 'seed=1', '--cfg', 'job']
    """
    words: list[str] = []
    others: list[str] = []
    for before, argument in zip(("", *arguments), arguments, strict=False):
        after_option = before.startswith("-") and before not in _ALONE
        is_word = argument != "" and "=" not in argument and not argument.startswith("-") and not after_option
        (words if is_word else others).append(argument)
    option = WORDS.get(command)
    if option is None or not words:
        return list(arguments)
    if option in _LISTS:
        return [f"{option}=[{','.join(words)}]", *others]
    return [f"{option}='{words[0]}'", *words[1:], *others]
