"""The `csm` program as a whole: what it says of itself, and that Hydra answers for every command."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest
from hydra.core.global_hydra import GlobalHydra
from omegaconf import OmegaConf

import csm
from csm.commands.help import IDLE
from csm.commands.main import COMMANDS, main


@pytest.fixture
def run(monkeypatch, tmp_path, capsys):
    """Return a function that runs ``csm WORDS`` in an empty folder and gives what it prints."""

    def call(*words: str) -> str:
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(sys, "argv", ["csm", *words])
        GlobalHydra.instance().clear()
        try:
            main()
        except SystemExit as stopped:  # Hydra ends so after --help
            if stopped.code:
                raise
        return str(capsys.readouterr().out)

    return call


@pytest.mark.parametrize("words", [[], ["--help"], ["-h"], ["help"]])
def test_help_lists_every_command_with_what_it_does(run, words):
    text = run(*words)
    for name, purpose in COMMANDS.items():
        assert f"{name} " in text
        assert purpose in text


def test_version_is_that_of_the_package(run):
    assert run("--version").strip() == csm.__version__


def test_an_unknown_command_ends_with_status_2_and_says_where_to_look(run, capsys):
    with pytest.raises(SystemExit) as stopped:
        run("trian", "experiment=demo")
    assert stopped.value.code == 2
    message = capsys.readouterr().err
    assert "'trian'" in message
    assert "csm --help" in message


@pytest.mark.parametrize("command", COMMANDS)
def test_cfg_job_prints_the_configuration_and_runs_nothing(run, command, tmp_path):
    cfg = OmegaConf.create(run(command, "--cfg", "job", "workers=7"))
    assert cfg.workers == 7
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("command", COMMANDS)
def test_help_explains_every_command(run, command, tmp_path):
    text = run(command, "--help")
    assert text.startswith(f"usage: csm {command} ")
    assert ("  workers=null " in text) == ("workers" not in IDLE.get(command, ()))
    assert list(tmp_path.iterdir()) == []


def test_a_command_is_also_a_module_and_an_error_is_one_paragraph_with_status_2(tmp_path):
    words = [sys.executable, "-m", "csm.commands.describe", f"mesh={tmp_path / 'nothing.off'}", "out=d.npz"]
    ended = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True)
    assert ended.returncode == 2
    assert "nothing.off" in ended.stderr
    assert "Traceback" not in ended.stderr


def test_a_backend_of_pictures_that_is_not_installed_disturbs_no_command(tmp_path):
    """As in a notebook, whose kernel may live in another environment."""
    words = [sys.executable, "-m", "csm.commands.train", "--cfg", "job"]
    environment = {**os.environ, "MPLBACKEND": "module://no_such.backend"}
    ended = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, env=environment, check=False)
    assert ended.returncode == 0, ended.stderr
