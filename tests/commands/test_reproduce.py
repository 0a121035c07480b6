from __future__ import annotations

import json
import sys

import pytest
from hydra import compose, initialize_config_dir
from hydra.core.global_hydra import GlobalHydra

from csm.commands.choices import config_folder
from csm.commands.groups import plain
from csm.commands.main import main
from csm.reproduction.registry import STUDIES, options_of
from tests.remeshedset import write_faust


@pytest.fixture
def run(monkeypatch, tmp_path):
    """Return a function that runs ``csm WORDS`` in a folder with toy data."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("CSM_CACHE", str(tmp_path / "store"))
    monkeypatch.setenv("COLUMNS", "200")

    def call(*words: str) -> None:
        monkeypatch.setattr(sys, "argv", ["csm", *words])
        GlobalHydra.instance().clear()
        main()

    return call


def test_words_are_studies_and_each_leaves_its_files(run, tmp_path, capsys):
    write_faust(tmp_path / "data" / "FAUST")
    options = ["table1.sets=[faust]", "table1.descriptors=[acd_paper]", "table1.exact_points=10", "workers=1"]
    run("reproduce", "table1", *options, "figure4", "results=shown")
    files = {f"{name}.{suffix}" for name in ("table1", "figure4") for suffix in ("json", "csv", "md", "png")}
    assert files <= {path.name for path in (tmp_path / "outputs/reproduce").iterdir()}
    assert files == {path.name for path in (tmp_path / "shown").iterdir()}
    record = json.loads((tmp_path / "shown/table1.json").read_text())
    assert record["command"].startswith("csm reproduce table1 ")
    assert "| acd_paper | 77 |" in capsys.readouterr().out


def test_help_lists_the_studies(run, capsys):
    run("reproduce", "--help")
    text = capsys.readouterr().out
    for name, study in STUDIES.items():
        assert f"{name} " in text
        assert study.purpose in text


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "needs names of studies"),
        (["table9"], "there is no study 'table9'"),
        (["table1", "+table1.colour=red"], "table1 has no option colour"),
        (["table1", "data.root=nowhere"], "none of the sets"),
    ],
)
def test_errors_are_one_paragraph_and_status_2(run, capsys, words, message):
    with pytest.raises(SystemExit) as stopped:
        run("reproduce", *words, "hydra.run.dir=failed")
    assert stopped.value.code == 2
    assert message in capsys.readouterr().err


@pytest.mark.parametrize("name", STUDIES)
def test_the_options_of_the_configuration_are_those_of_the_study(name):
    with initialize_config_dir(str(config_folder()), version_base="1.3"):
        cfg = compose("reproduce")
    assert plain(cfg[name]) == options_of(name)


def test_options_that_follow_another_study_follow_its_changes():
    with initialize_config_dir(str(config_folder()), version_base="1.3"):
        cfg = compose("reproduce", ["table1.descriptors=[acd]", "table1.points=7", "table4.overrides=[a]"])
    assert plain(cfg.figure4)["points"] == 7
    assert plain(cfg.figure7)["overrides"] == ["a"]
    for name in ("figure4", "figure5", "figure6", "stability", "table2"):
        assert plain(cfg[name])["descriptors"] == ["acd"]
