from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import pytest
from hydra import compose, initialize_config_dir
from hydra.core.global_hydra import GlobalHydra

from csm.commands.choices import config_folder
from csm.commands.groups import register
from csm.commands.schema import Range, described, fits, require_valid
from csm.errors import ConfigError

register("data", "descriptor", "model")


def composed(command: str, *overrides: str):
    GlobalHydra.instance().clear()
    with initialize_config_dir(str(config_folder()), version_base="1.3"):
        return compose(command, [*overrides, *(["name=x"] if command in ("train", "prepare") else [])])


@pytest.mark.parametrize("command", ["train", "evaluate", "matrix", "match", "describe", "check", "clean", "prepare"])
def test_the_defaults_are_valid(command):
    require_valid(composed(command))


@pytest.mark.parametrize("experiment", ["demo", "humans", "humans_rival", "faust_short"])
def test_experiments_are_valid(experiment):
    roots = ["data.root=x"] if "faust" in experiment else []
    require_valid(composed("train", f"experiment={experiment}", *roots))


@pytest.mark.parametrize(
    ("override", "said"),
    [
        ("seed=-1", "seed=-1: wanted a whole number from 0"),
        ("seed=1.5", "seed=1.5: wanted a whole number"),
        ("trainer.max_epochs=-5", "trainer.max_epochs=-5: wanted a whole number from 0"),
        ("trainer.max_epochs=many", "trainer.max_epochs=many"),
        ("optimizer.lr=nan", "optimizer.lr=nan: wanted a number above 0"),
        ("optimizer.lr=fast", "optimizer.lr=fast"),
        ("optimizer.lr=0", "optimizer.lr=0: wanted a number above 0"),
        ("optimizer.schedule=cosin", "optimizer.schedule=cosin: wanted constant, cosine, step, drop or one_cycle"),
        ("model.ks=0", "model.ks=0: wanted a whole number from 1"),
        ("model.channels=[]", "model.channels=[]: wanted one or more of: a whole number from 1"),
        ("model.channels=[16,0]", "model.channels=[16, 0]: wanted one or more of: a whole number from 1"),
        ("model.ks=many", "model.ks=many"),
        ("model.name=csmcn", "model.name=csmcn: there is no such network; did you mean csmcnn"),
        ("+model.depth=3", "model.depth: there is no such option"),
        ("workers=abc", "workers=abc: wanted a whole number from 0, or null"),
        ("workers=true", "workers=True"),
        ("descriptor.alpha=strong", "descriptor.alpha=strong: wanted a number"),
        ("descriptor.angles=2.5", "descriptor.angles=2.5: wanted a whole number"),
        ("descriptor.frame=smoth", "descriptor.frame=smoth: wanted"),
        ("+descriptor.foo=1", "descriptor.foo: there is no such option"),
        ("+optimizer.learning_rate=1", "optimizer.learning_rate: there is no such option"),
        ("+learning.foo=1", "learning.foo: there is no such option"),
        ("+trainer.max_epoch=1", "trainer.max_epoch: there is no such option; did you mean max_epochs"),
        ("+callbacks.errors.foo=1", "callbacks.errors.foo: there is no such option"),
        ("+data.unknown=1", "data.unknown: there is no such option"),
        ("data=folder", "data.root has to be given: data.root=VALUE"),
        ("metric.distance=exakt", "metric.distance=exakt: wanted exact, heat or edge"),
        ("metric.points=0", "metric.points=0: wanted a whole number from 1, or null"),
        ("metric.points=abc", "metric.points=abc"),
        ("debug=maybe", "debug=maybe: wanted true or false"),
        ("descriptor._target_=csm.descriptors.NOPE", "there is no such class or function"),
    ],
)
def test_a_value_that_cannot_work_is_named_before_anything_is_done(override, said):
    with pytest.raises(ConfigError) as refused:
        require_valid(composed("train", override))
    assert said in str(refused.value)


def test_options_of_classes_from_elsewhere_are_known_too():
    stop = "+callbacks.stop={_target_: lightning.pytorch.callbacks.EarlyStopping, monitor: val/age}"
    require_valid(composed("train", stop))
    with pytest.raises(ConfigError, match=r"callbacks\.stop\.monitr: there is no such option; did you mean monitor"):
        require_valid(composed("train", stop.replace("monitor:", "monitr:")))


def test_a_range_says_what_it_takes():
    assert str(Range(True, 0, 4, none=True)) == "a whole number from 0 to 4, or null"
    assert str(Range(False, 0, above=True)) == "a number above 0"
    assert [Range(True, 0).holds(v) for v in (0, True, None, 1.0, -1)] == [True, False, False, False, False]


@pytest.mark.parametrize(
    ("value", "hint", "held"),
    [
        ([1, 2], Sequence[int], True),
        ([1, "a"], Sequence[int], False),
        ("ab", Sequence[str] | str, True),
        (float("inf"), float, False),
        ("x", Literal["x", "y"] | None, True),
        ("z", Literal["x", "y"] | None, False),
        (object(), object, True),
    ],
)
def test_plain_values_fit_annotations(value, hint, held):
    assert fits(value, hint) is held


def test_annotations_are_said_in_words():
    assert described(int | None) == "a whole number or null"
    assert described(Sequence[float]) == "a list ([...]) of: a number"
