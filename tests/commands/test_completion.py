from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from csm.commands.completion import SCRIPTS, candidates, run
from csm.commands.main import COMMANDS


@pytest.mark.parametrize(
    ("line", "wanted"),
    [
        ("csm swee", ["sweep-report"]),
        ("csm compl", ["completion"]),
        ("csm completion z", ["zsh"]),
        ("csm match a.off b.off refi", ["refine="]),
        ("csm match a.off b.off model=h", ["model=humans", "model=humans_parts"]),
        ("csm match a.off b.off refine=multi", ["refine=multistart"]),
        ("csm train recipe=ow", ["recipe=own"]),
        ("csm train learning.stand", ["learning.standardise="]),
        ("csm train trainer.max_ep", ["trainer.max_epochs="]),
        ("csm train data.al", ["data.also="]),
        ("csm train matching=arg", ["matching=argmax"]),
        ("csm reproduce table1 figure1", ["figure10", "figure11", "figure12", "figure13"]),
        ("csm bench match", ["matching"]),
        ("csm match debug=", ["debug=true", "debug=false"]),
    ],
)
def test_the_last_word_is_completed(line, wanted):
    assert candidates(line) == wanted


@pytest.mark.parametrize(
    "line", ["csm match a", "csm match out=", "csm fly hi", "csm train --", "csm evaluate checkpoint=m"]
)
def test_paths_and_unknown_words_are_left_to_the_shell(line):
    assert candidates(line) == []


@pytest.mark.parametrize("command", [name for name in COMMANDS if name != "sweep-report"])
def test_every_command_has_keys(command):
    assert f"{'out' if command in ('match', 'clean') else 'debug'}=" in candidates(f"csm {command} ")


def test_other_arguments_are_not_understood():
    assert run(["tcsh"]) is None
    assert run([]) is None


def test_bash_replaces_what_stands_after_the_equals_sign(tmp_path: Path):
    bash = shutil.which("bash")
    if bash is None:
        pytest.skip("there is no bash here")
    program = tmp_path / "csm"
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m csm "$@"\n')
    program.chmod(0o755)
    ask = (
        'COMP_LINE="csm match a.off refine=mu"; COMP_POINT=${#COMP_LINE}; COMP_WORDBREAKS="=:"; '
        'COMP_WORDS=(csm match a.off refine = mu); COMP_CWORD=5; _csm; printf "%s\\n" "${COMPREPLY[@]}"'
    )
    found = subprocess.run(
        [bash, "-c", f"{SCRIPTS['bash']}\n{ask}"],
        env={**os.environ, "PATH": f"{tmp_path}:{os.environ['PATH']}"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert found.stdout.split() == ["multistart"]
