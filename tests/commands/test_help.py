from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from omegaconf import OmegaConf

import csm.commands
from csm.commands.choices import config_folder
from csm.commands.groups import data_configs
from csm.commands.help import IDLE, SETTINGS, help_text, read_page
from csm.commands.main import COMMANDS
from csm.reproduction.registry import STUDIES, explained


@pytest.mark.parametrize("command", COMMANDS)
def test_every_option_of_every_command_is_explained(command):
    page = read_page(command)
    assert page.purpose
    unexplained = [key for key, _, words in page.options if not words and key not in ("source", "target")]
    assert unexplained == []
    text = help_text(command)
    assert all(f"  {key}=" in text for key, *_ in page.options)


@pytest.mark.parametrize("command", COMMANDS)
def test_shared_options_are_shown_where_they_do_something(command):
    shown = {key for key, *_ in read_page(command).options}
    assert "debug" in shown
    assert {"store", "device", "workers"} - shown == set(IDLE.get(command, ()))
    source = (Path(csm.commands.__file__).parent / f"{command.replace('-', '_')}.py").read_text()
    assert not any(f"cfg.{key}" in source for key in IDLE.get(command, ()))


def test_groups_are_listed_with_their_options_and_single_ones_as_settings():
    text = help_text("train")
    assert "csmcnn_paper (default)" in text
    assert "optimizer.lr=" in text
    assert "optimizer  " not in text.split("groups, of which")[1]
    assert "groups" not in help_text("check")


def test_settings_of_data_and_trainer_that_are_named_exist_and_do_what_is_said():
    text = help_text("train")
    known = {f"data.{key}" for node in data_configs().values() for key in node}
    known |= {f"trainer.{key}" for key in OmegaConf.load(config_folder() / "trainer" / "default.yaml")}
    named = {example.partition("=")[0] for example in SETTINGS["train"]}
    assert named <= known
    assert {"data.also", "data.split", "data.holdout", "data.root", "trainer.max_epochs"} <= named
    assert all(f"  {example}" in text for example in SETTINGS["train"])


def test_words_without_a_key_are_in_the_usage():
    assert help_text("match").startswith("usage: csm match SOURCE TARGET [OUT] [key=value ...]")
    assert help_text("bench").startswith("usage: csm bench [TARGETS ...] [key=value ...]")


def test_no_line_is_wider_than_a_terminal():
    assert max(len(line) for command in COMMANDS for line in help_text(command).splitlines()) <= 120


def test_the_program_is_also_a_module():
    words = [sys.executable, "-m", "csm", "--help"]
    assert subprocess.run(words, capture_output=True, text=True, check=True).stdout.startswith("csm ")


def test_a_study_that_is_named_has_its_options_explained():
    text = help_text("bench", ["descriptors", "--help"])
    assert "table2.repeats=3" in text
    assert "Measurements, of which the median counts." in text
    assert text.count("targets=[]") == 1
    assert "studies, each with" not in help_text("reproduce", ["table1", "--help"])


@pytest.mark.parametrize("study", STUDIES)
def test_every_option_of_every_study_is_explained(study):
    assert [key for key, words in explained(study).items() if not words] == []
