"""The `csm` program: one word chooses the command, the rest is Hydra's.

Help is given before the module of a command is imported, which takes seconds.
"""

from __future__ import annotations

import importlib
import os
import sys
from pathlib import Path
from typing import NoReturn

from csm import __version__
from csm._signals import exit_status, terminable
from csm.commands.words import asks_for_help, nearest_names

COMMANDS = {
    "train": "train a network on one set and test it on others",
    "evaluate": "test a checkpoint on other sets or resolutions",
    "matrix": "train once per training set, evaluate on every test set, resumable cell by cell",
    "match": "match two meshes of your own",
    "describe": "compute a descriptor of one mesh",
    "clean": "mend a mesh: weld, split, drop debris, orient; with the map from its old vertices to the new ones",
    "bodies": "make human bodies by the thousand to train on, on this machine, from the body model anny",
    "prepare": "fill, check or prune the store of bases and descriptors",
    "check": "list what is wrong with meshes: files, or a folder",
    "reproduce": "make tables and figures of the paper again from data",
    "sweep-report": "make one page of a sweep: its jobs, what each parameter does, the best settings",
    "doctor": "say what csm finds on this machine, and what is missing",
    "bench": "measure what descriptors, networks or whole matchings cost, also beside other libraries",
}

COMPLETION = "completion"
"""The word after which a shell is named whose completion is printed; it takes no options, unlike commands."""


def usage() -> str:
    """Return the text of ``csm --help``."""
    rows = "\n".join(f"  {name:<14}{text}" for name, text in COMMANDS.items())
    return (
        f"csm {__version__}: dense correspondence between deformable meshes with spectral descriptors\n\n"
        f"usage: csm COMMAND [key=value ...]\n\n{rows}\n\n"
        "csm COMMAND --help explains the options, --cfg job shows the resolved configuration,\n"
        "-m key=a,b,c runs every combination. An example that needs no data: csm train experiment=demo\n"
        "csm completion bash (zsh, fish) prints what completes these words in that shell."
    )


def main() -> None:
    """Run ``csm``; exit status 2 after an error that the user can mend."""
    try:
        _main(sys.argv[1:])
        if sys.stdout is not None:  # it is closed in csm ... >&-
            sys.stdout.flush()
    except BrokenPipeError:  # whoever reads has read enough, as in csm --help | head
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)


def _main(arguments: list[str]) -> None:
    if not arguments or arguments[0] in ("-h", "--help", "help"):
        print(usage())
        return
    if arguments[0] in ("-V", "--version"):
        print(__version__)
        return
    if arguments[0] == COMPLETION:
        _complete(arguments[1:])
        return
    if arguments[0] not in COMMANDS:
        near = nearest_names(arguments[0], COMMANDS)
        print(f"csm: there is no command {arguments[0]!r}{near}; csm --help lists them", file=sys.stderr)
        sys.exit(2)
    sys.argv = [f"csm {arguments[0]}", *arguments[1:]]
    run_command(arguments[0])


def _complete(arguments: list[str]) -> None:
    from csm.commands import completion

    wanted = f"csm completion: wanted {', '.join(completion.SCRIPTS)}, as in source <(csm completion bash)"
    if asks_for_help(arguments):
        print(wanted)
        return
    if (text := completion.run(arguments)) is None:
        print(wanted, file=sys.stderr)
        sys.exit(2)
    print(text, end="")


def run_as_program(module: str) -> NoReturn:
    """Run a command as ``python -m csm.commands.NAME`` does, and end the process.

    Its module calls this before it imports anything else, so that a Ctrl-C meanwhile ends in order.

    Parameters
    ----------
    module
        Name of the file of the command's module.
    """
    run_command(Path(module).stem.replace("_", "-"))
    sys.exit()


def run_command(name: str) -> None:
    """Run a command with the arguments of the process, or print its help."""
    if asks_for_help(sys.argv[1:]):
        from csm.commands.help import help_text

        print(help_text(name, sys.argv[1:]))
        return
    os.environ["MPLBACKEND"] = "agg"  # pictures go to files; a notebook names a backend that need not be installed here
    try:
        with terminable():
            importlib.import_module(f"csm.commands.{name.replace('-', '_')}").main()
    except KeyboardInterrupt as stop:  # while modules are loaded; later the command itself says what is kept
        print("csm: stopped before anything was done", file=sys.stderr)
        sys.exit(exit_status(stop))
