from __future__ import annotations

import json
from dataclasses import replace

import pytest

from csm import descriptors
from csm.descriptors import ACD, FAMILIES, HKS, PRESETS, Constant, Stack, from_parameters, preset
from csm.descriptors.base import record
from csm.descriptors.presets import SETTINGS, classes
from csm.errors import ConfigError


def test_paper_and_release_are_the_settings_of_the_table():
    plain = {"smoothing": 0.08, "centred": False, "cuts": 1, "damping": 0.0}
    assert preset("acd_paper") == ACD(10, 20, 10, 6, False, "line_field", 3, **plain)
    assert preset("acd_release") == ACD(4, 8, 70, 5, True, "line_field", 3, **plain)
    assert preset("acd_release_frame") == ACD(4, 8, 70, 5, True, "released", 10, **plain)


def test_acd_without_settings_is_what_the_commands_use():
    own = {"k": 11, "order": 7, "frame": "smooth", "centred": True, "cuts": 4, "damping": 0.5}
    assert preset("acd") == ACD() == replace(ACD.paper(), **own)


@pytest.mark.parametrize("name", [name for name in PRESETS if {"k", "bins"} & set(PRESETS[name].parameters())])
def test_a_preset_lets_its_parameters_be_replaced(name):
    before = preset(name).parameters()
    key = "k" if "k" in before else "bins"
    assert preset(name, **{key: 33}).parameters() == before | {key: 33}


@pytest.mark.parametrize("name", list(PRESETS))
def test_every_preset_comes_back_from_its_record(name):
    descriptor = PRESETS[name]
    assert from_parameters(**json.loads(json.dumps(record(descriptor)))) == descriptor


def test_a_stack_comes_back_from_its_record():
    stack = Stack({"a": ACD.paper(), "b": Stack({"c": HKS(first=0.1, last=1.0)})})
    assert from_parameters(**json.loads(json.dumps(record(stack)))) == stack


def test_records_from_before_a_parameter_was_added_have_its_neutral_value():
    """As the first release wrote them."""
    acd = {"alpha": 10.0, "angles": 20, "k": 10, "order": 6, "normalise": False, "frame": "line_field", "sweeps": 3}
    acd |= {"smoothing": 0.08, "centred": False, "cuts": 1}
    assert from_parameters("acd", **acd) == ACD.paper()
    assert from_parameters("hks", k=300, n_times=100, scaled=True) == HKS()


def test_records_that_say_too_much_or_too_little_are_refused():
    with pytest.raises(ConfigError, match=r"unknown: energies; missing: n_energies, variant"):
        from_parameters("wks", k=300, energies=100)
    with pytest.raises(ConfigError, match="unknown: k; missing: none"):
        from_parameters("stack", parts={}, k=3)
    with pytest.raises(ConfigError, match="no descriptor family 'sihks'; there are acd"):
        from_parameters("sihks")


def test_records_of_another_version_are_refused():
    assert from_parameters("gps", k=3, absolute=True, version=1) == preset("gps", k=3)
    with pytest.raises(ConfigError, match="the record is of version 2, but this csm computes version 1"):
        from_parameters("gps", k=3, absolute=True, version=2)
    with pytest.raises(ConfigError, match="version 3"):
        from_parameters("stack", parts={"a": record(preset("gps")) | {"version": 3}})


def test_a_registered_family_is_in_the_package_and_known_by_name(monkeypatch):
    class Fresh(Constant):
        name = "fresh"

    assert all(getattr(descriptors, type(each).__name__) is FAMILIES[each.name] for each in PRESETS.values())
    with pytest.raises(AttributeError, match="Fresh"):
        descriptors.Fresh  # noqa: B018
    monkeypatch.setitem(FAMILIES, "fresh", Fresh)
    assert from_parameters("fresh") == Fresh()
    monkeypatch.setitem(SETTINGS, "fresh_two", ("fresh:Fresh.other", {}))
    assert classes()["csm.descriptors.fresh"] == ("Fresh",)


def test_unknown_names_parameters_and_values_are_refused():
    with pytest.raises(ConfigError, match="acd_paper"):
        preset("acdc")
    with pytest.raises(ConfigError, match=r"no parameter q; it has alpha"):
        preset("acd_paper", q=1)
    with pytest.raises(ConfigError, match="wanted"):
        preset("acd_paper", k=0)
