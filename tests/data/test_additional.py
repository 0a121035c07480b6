from __future__ import annotations

from dataclasses import replace

import pytest

from csm.data.additional import additional
from csm.data.base import DataModule
from csm.data.registry import recognise
from csm.data.splits import Split
from csm.data.store import Store
from csm.descriptors import HKS
from csm.errors import ConfigError, DataError
from tests.toyset import write_toys

SPLIT = Split("mine", ("toy0", "toy1"), ("toy4", "toy5"))


@pytest.fixture(scope="module")
def toys(tmp_path_factory):
    return recognise(write_toys(tmp_path_factory.mktemp("also") / "toys"))


def test_the_same_shapes_share_a_template_and_humans_have_their_own(toys, tmp_path):
    more = additional("refined_200", toys, SPLIT.train, Store(tmp_path))
    assert (more.template, more.names) == ("", SPLIT.train)
    humans = additional("humans_remeshed_5000", toys, SPLIT.train, Store(tmp_path))
    assert (humans.template, len(humans.names), humans.shapes.name) == ("humans", 80, "humans_remeshed_5000")
    assert additional("humans", toys, SPLIT.train, Store(tmp_path)).n_classes == 6899


@pytest.mark.parametrize("text", ["faust", "remeshed", "remeshed_x", "humans_5000", "", "humans_bent_3"])
def test_an_unknown_name_is_answered_with_the_forms(toys, tmp_path, text):
    with pytest.raises(ConfigError, match=r"data.also: .* wanted a FORM \(refined_N, remeshed_N or uneven_N"):
        additional(text, toys, SPLIT.train, Store(tmp_path))


@pytest.mark.data
def test_a_set_of_the_data_folder_has_a_template_of_its_own(data_set, toys, tmp_path, monkeypatch):
    monkeypatch.setenv("CSM_DATA", str(data_set("SCAPE_5000").parent))
    more = additional("SCAPE_5000", toys, SPLIT.train, Store(tmp_path))
    assert (more.template, len(more.names)) == ("SCAPE_5000", 51)


def test_a_set_that_is_not_in_the_data_folder_is_named(toys, tmp_path, monkeypatch):
    monkeypatch.setenv("CSM_DATA", str(tmp_path))
    with pytest.raises(DataError, match="wanted FAUST_6890, but no published set"):
        additional("FAUST_6890", toys, SPLIT.train, Store(tmp_path))


def test_the_bodies_of_the_training_set_are_refused_as_test_shapes_may_be_among_them(toys, tmp_path):
    faust = replace(toys, name="FAUST_6890")
    with pytest.raises(ConfigError, match="FAUST_5k_remeshed has the bodies of the training set, FAUST_6890"):
        additional("FAUST_5k_remeshed", faust, SPLIT.train, Store(tmp_path))


def test_a_data_module_prepares_and_names_them(toys, tmp_path):
    data = DataModule(
        toys,
        [toys],
        SPLIT,
        descriptor=HKS(k=6, n_times=3),
        basis_k=8,
        workers=0,
        store=Store(tmp_path),
        also=["remeshed_200"],
    )
    data.prepare()
    assert f"2 shapes of {toys.name} and 2 shapes of {toys.name}_remeshed_200" in data.protocol
    assert data.also_classes == {}
