"""What a command imports before it can answer: nothing heavy for its help, and for its work only what that needs."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from csm.commands.main import COMMANDS
from csm.mesh.io import write_mesh
from tests.shapes import blob

HEAVY = {"lightning", "tensorboard", "matplotlib", "h5py", "pandas"}
SAYING_WHAT_IS_LOADED = (
    "import json, sys\n"
    "from csm.commands.main import main\n"
    "try:\n"
    "    main()\n"
    "finally:\n"
    "    print(json.dumps([name for name in sys.modules if '.' not in name]))"
)


def loaded_by(folder: Path, *words: str, status: int = 0) -> set[str]:
    """Run ``csm WORDS`` in a process of its own and return the packages that it has imported in the end."""
    variables = os.environ | {"CSM_CACHE": str(folder / "store")}
    line = [sys.executable, "-c", SAYING_WHAT_IS_LOADED, *words]
    ended = subprocess.run(line, cwd=folder, env=variables, capture_output=True, text=True, check=False)
    assert ended.returncode == status, ended.stderr
    return set(json.loads(ended.stdout.splitlines()[-1]))


@pytest.mark.parametrize("command", COMMANDS)
def test_help_loads_nothing_heavy(command, tmp_path):
    assert not {*HEAVY, "torch", "scipy", "hydra", "omegaconf"} & loaded_by(tmp_path, command, "--help")


def test_the_list_of_commands_and_the_package_load_no_numbers(tmp_path):
    assert not {"numpy", "hydra", "omegaconf"} & loaded_by(tmp_path, "--help")


@pytest.mark.parametrize("command", ["train", "evaluate", "matrix", "prepare", "reproduce", "bench"])
def test_a_misspelt_option_is_answered_before_lightning_is_loaded(command, tmp_path):
    assert "lightning" not in loaded_by(tmp_path, command, "data.roott=x", status=2)


@pytest.fixture
def two_meshes(tmp_path):
    for seed in (1, 2):
        write_mesh(tmp_path / f"{seed}.off", blob(2, seed))
    return tmp_path


def test_matching_by_a_descriptor_loads_no_network_and_no_plots(two_meshes):
    loaded = loaded_by(two_meshes, "match", "1.off", "2.off", "plain", "refine=none")
    assert (two_meshes / "plain/match.html").is_file()
    assert not {*HEAVY, "torch"} & loaded
    loaded = loaded_by(two_meshes, "match", "1.off", "2.off", "refined")
    assert not HEAVY & loaded
    assert "torch" in loaded, "refinements compute with PyTorch"


def test_matching_by_a_network_needs_no_training(two_meshes):
    for seed in (1, 2):
        write_mesh(two_meshes / f"{seed}.off", blob(3, seed))  # enough vertices for its 256 eigenpairs
    loaded = loaded_by(two_meshes, "match", "1.off", "2.off", "learned", "model=humans", "refine=none")
    assert not HEAVY & loaded
    assert "torch" in loaded


@pytest.mark.parametrize("words", [("check", "1.off"), ("clean", "1.off", "c.off"), ("describe", "1.off", "d.npz")])
def test_what_needs_one_mesh_loads_no_network_and_no_plots(two_meshes, words):
    assert not {*HEAVY, "torch"} & loaded_by(two_meshes, *words)


@pytest.mark.parametrize("command", COMMANDS)
def test_ctrl_c_while_a_command_is_loaded_ends_in_order(command, tmp_path):
    """A module of the name of one that every command imports raises what Ctrl-C does at that moment."""
    (tmp_path / "hydra.py").write_text("raise KeyboardInterrupt\n")
    variables = os.environ | {"PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])}
    whole = ["-c", "from csm.commands.main import main; main()", command]
    for line in (["-m", f"csm.commands.{command.replace('-', '_')}"], whole):
        ended = subprocess.run(
            [sys.executable, *line], cwd=tmp_path, env=variables, capture_output=True, text=True, check=False
        )
        assert ended.returncode == 130
        assert ended.stderr == "csm: stopped before anything was done\n"
