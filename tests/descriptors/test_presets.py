from __future__ import annotations

import json

import pytest

from csm.descriptors import ACD, PRESETS, from_parameters, preset
from csm.errors import ConfigError


def test_paper_and_release_are_the_settings_of_the_table():
    assert preset("acd_paper") == ACD(alpha=10, angles=20, k=10, order=6, normalise=False, frame="line_field", sweeps=3)
    assert preset("acd_release") == ACD(4, 8, 70, 5, True, "line_field", 3)
    assert preset("acd_release_frame") == ACD(4, 8, 70, 5, True, "released", 10)


@pytest.mark.parametrize("name", [name for name in PRESETS if {"k", "bins"} & set(PRESETS[name].parameters())])
def test_a_preset_lets_its_parameters_be_replaced(name):
    before = preset(name).parameters()
    key = "k" if "k" in before else "bins"
    assert preset(name, **{key: 33}).parameters() == before | {key: 33}


@pytest.mark.parametrize("name", list(PRESETS))
def test_every_preset_comes_back_from_its_record(name):
    descriptor = PRESETS[name]
    record = json.loads(json.dumps({"name": descriptor.name, **descriptor.parameters()}))
    assert from_parameters(**record) == descriptor


def test_unknown_names_parameters_and_values_are_refused():
    with pytest.raises(ConfigError, match="acd_paper"):
        preset("acdc")
    with pytest.raises(ConfigError, match=r"no parameter q; it has alpha"):
        preset("acd_paper", q=1)
    with pytest.raises(ConfigError, match="wanted"):
        preset("acd_paper", k=0)
