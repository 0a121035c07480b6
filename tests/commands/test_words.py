from __future__ import annotations

import pytest
from hydra.core.override_parser.overrides_parser import OverridesParser
from hypothesis import given
from hypothesis import strategies as st
from omegaconf import OmegaConf

from csm.commands.words import nearest_names, quoted, to_overrides
from csm.errors import ConfigError

NAMES = ["a b (1).off", "it's.ply", "x=y.obj", "[1].off", "é~#,{}.off", "2024", "null", 'a"b.off', "a\\b", "true"]
NAMES += ["-dash.off", "~tilde.off"]


def parsed(override: str) -> object:
    return OverridesParser.create().parse_override(override).value()


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("form", ["{}", "source={}"])
def test_any_path_reaches_the_configuration_as_it_was_typed(tmp_path, monkeypatch, name, form):
    monkeypatch.chdir(tmp_path)
    (tmp_path / name).touch()
    (override,) = to_overrides("match", [form.format(name)])
    assert override.startswith("source=")
    wanted = None if (name, form) == ("null", "source={}") else name
    assert parsed(override) == wanted


@given(st.text(st.characters(blacklist_categories=("Cs", "Cc")), min_size=1))
def test_quotes_hold_any_text(text):
    assert parsed(f"out={quoted(text)}") == text


def test_words_get_their_keys_in_order_and_options_may_stand_anywhere():
    assert to_overrides("match", ["a.off", "device=cpu", "b.off", "o"]) == [
        *("source='a.off'", "target='b.off'", "out='o'", "device=cpu")
    ]
    assert to_overrides("check", ["--cfg", "job", "meshes"]) == ["paths=['meshes']", "--cfg", "job"]
    assert to_overrides("reproduce", ["table1", "seed=1", "figure4"]) == ["targets=[table1,figure4]", "seed=1"]


def test_the_home_folder_is_found(monkeypatch):
    monkeypatch.setenv("HOME", "/home/someone")
    assert to_overrides("match", ["~/a.off", "out=~/o"]) == ["source='/home/someone/a.off'", "out='/home/someone/o'"]


def test_the_sweep_flag_comes_first_wherever_it_stands():
    typed = ["experiment=humans", "-m", "seed=0,1", "--multirun"]
    assert to_overrides("train", typed) == ["-m", "experiment=humans", "seed=0,1"]


def test_in_a_sweep_a_list_of_paths_stays_a_list_unless_a_file_has_that_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert to_overrides("evaluate", ["-m", "checkpoint=a b.ckpt,c.ckpt"]) == ["-m", "checkpoint='a b.ckpt','c.ckpt'"]
    (tmp_path / "a,b.ckpt").touch()
    assert to_overrides("evaluate", ["-m", "checkpoint=a,b.ckpt"]) == ["-m", "checkpoint='a,b.ckpt'"]


def test_lists_of_paths_are_quoted_one_by_one():
    assert parsed(to_overrides("train", ["data.test_roots=[p q/meshes,r=s]"])[0]) == ["p q/meshes", "r=s"]


def test_what_is_no_path_is_left_to_hydra():
    typed = ["~logger", "+data.x=1", "matching=[nearest,argmax]", "store=${oc.env:X}", "results=null", "out='x y'"]
    assert to_overrides("train", typed) == typed


def test_groups_can_be_left_out_with_null():
    assert to_overrides("train", ["logger=null", "experiment=null", "recipe=", "resume=null"]) == [
        *("logger=none", "resume=null")
    ]


@pytest.mark.parametrize(
    ("command", "typed", "said"),
    [
        ("train", ["humans"], "got 'humans'; did you mean experiment=humans?"),
        ("train", ["wks"], "did you mean descriptor=wks?"),
        ("match", ["a", "b", "c", "d"], "takes SOURCE TARGET OUT and options of the form key=value, got 'd'"),
    ],
)
def test_a_word_too_many_is_named(command, typed, said):
    with pytest.raises(ConfigError) as refused:
        to_overrides(command, typed)
    assert said in str(refused.value)


@pytest.mark.parametrize(
    ("command", "typed", "said"),
    [
        ("train", "experiment=table4", "table of several trainings: csm matrix experiment=table4"),
        ("prepare", "experiment=faust,lab", "csm matrix experiment=lab"),
        (
            "matrix",
            "experiment=demo",
            "is one training and no table: csm train experiment=demo; the tables are ablation",
        ),
    ],
)
def test_experiments_are_sent_to_the_command_that_runs_them(command, typed, said):
    with pytest.raises(ConfigError) as refused:
        to_overrides(command, [typed])
    assert said in str(refused.value)
    assert to_overrides("matrix", ["experiment=table4"]) == ["experiment=table4"]
    assert to_overrides(command, ["experiment=of_my_own"]) == ["experiment=of_my_own"]


def test_settings_for_the_data_of_an_experiment_are_named_where_others_are_chosen():
    words = ["experiment=demo", "data=folder", "data.root=."]
    with pytest.raises(ConfigError) as refused:
        to_overrides("train", words)
    assert str(refused.value) == (
        "experiment=demo sets data.test and data.split for data=humans, and data=folder is another set; "
        "add ~data.test ~data.split, or give your own"
    )
    assert to_overrides("train", [*words, "~data.test", "data.split=null"])[-1] == "data.split=null"
    for fine in (
        ["experiment=demo", "data=humans"],
        ["experiment=faust", "data=scape"],
        ["experiment=tune", *words[1:]],
        ["experiment=demo", "descriptor=acd"],
        ["experiment=demo", "descriptor=hks", "~descriptor.angles"],
    ):
        to_overrides("train", fine)
    with pytest.raises(ConfigError, match=r"sets descriptor\.angles for descriptor=acd_paper, and descriptor=hks"):
        to_overrides("train", ["experiment=demo", "descriptor=hks"])


def test_only_near_names_are_offered():
    assert nearest_names("adc", ["acd", "hks"]) == "; did you mean acd?"
    assert nearest_names("zzz", ["acd", "hks"]) == ""
    assert nearest_names("exp", ["experiment", "sweeps"]) == "; did you mean experiment?"


def test_a_name_like_a_flag_or_a_reference_is_a_path_where_there_is_such_a_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("-dash.off", "${HOME}.off", "b.off"):
        (tmp_path / name).touch()
    assert to_overrides("match", ["-dash.off", "b.off"]) == ["source='-dash.off'", "target='b.off'"]
    (override, _) = to_overrides("match", ["${HOME}.off", "b.off"])
    assert OmegaConf.create({"source": parsed(override)}).source == "${HOME}.off"


@pytest.mark.parametrize(
    ("typed", "meant"), [("--out=z", "out=z"), ("-out", "out=VALUE"), ("--epochs", "epochs=VALUE")]
)
def test_options_with_dashes_are_answered_with_how_they_are_written(typed, meant):
    with pytest.raises(ConfigError, match=f"without dashes, {meant}"):
        to_overrides("match", ["a", "b", typed])


def test_overrides_in_a_list_are_quoted_one_by_one():
    typed = ["overrides=[trainer.max_epochs=1,data.test=[6890,10000]]", "model.channels=[1,2]", "+rows.a=['b=1']"]
    typed += ["a=[b=[1,[2,3]],c=choice(1,2)]", "a=[b=1],[b=2]", "a=[b=1]]", "a=[b=1,]", "a=interval(0,1)"]
    assert to_overrides("matrix", typed) == [
        "overrides=['trainer.max_epochs=1','data.test=[6890,10000]']",
        "model.channels=[1,2]",
        "+rows.a=['b=1']",
        "a=['b=[1,[2,3]]','c=choice(1,2)']",
        *typed[4:],
    ]
