from __future__ import annotations

import pytest

from csm.descriptors import PRESETS
from csm.networks import MODELS, build, settings
from csm.reproduction.published import AGE, ASSUMED, NETWORKS, RIVALS, SECONDS_AT_6890, SETS, family, label

COUNTS = {
    "splinecnn": 4_114_186,
    "acscnn": 4_803_178,
    "mgcn": 2_848_234,
    "csmcnn": 1_906_602,
    "diffusionnet": 1_351_786,
    "gcnn": 2_667_546,
}
"""At 6890 classes, from the publications' code; for GCNN from the sizes that later papers name."""
WIDTHS = {
    "acd_release": 48,
    "weds": 128,
    "constant": 1,
    "hks_diffusionnet": 16,
    "acd_paper": 140,
    "add": 256,
    "geometry_vectors": 150,
}


def test_every_descriptor_of_the_paper_has_a_preset_and_a_number_for_every_set():
    assert {family(name) for name in RIVALS} == set(AGE)
    assert all(set(row) == set(SETS) for row in AGE.values())
    assert list(dict.fromkeys(family(name) for name in RIVALS)) == list(AGE)


def test_every_rival_has_its_own_label():
    assert len({label(name) for name in RIVALS}) == len(RIVALS)


def test_the_paper_ranks_acd_first_everywhere():
    for key in SETS:
        assert min(AGE, key=lambda name: AGE[name][key]) == "acd"
    assert min(SECONDS_AT_6890, key=lambda name: SECONDS_AT_6890[name]) == "acd"


def test_guesses_are_about_families_whose_documentation_speaks_of_a_guess():
    classes = {family(name): type(descriptor) for name, descriptor in PRESETS.items()}
    assert set(ASSUMED) <= set(AGE)
    for name in AGE:
        assert (name in ASSUMED) == ("guess" in str(classes[name].__doc__)), name


@pytest.mark.parametrize("name", NETWORKS)
def test_every_network_can_be_built_and_has_its_published_size(name):
    setting = NETWORKS[name]
    assert setting.descriptor in PRESETS
    assert setting.model in MODELS
    network = build(in_channels=WIDTHS[setting.descriptor], n_classes=6890, **settings(setting.model))
    count = sum(p.numel() for p in network.parameters())
    assert count == COUNTS.get(name, pytest.approx(1.9e6, rel=0.2))
    assert setting.paper_millions is None or count == pytest.approx(1e6 * setting.paper_millions, rel=0.07)


@pytest.mark.parametrize("name", ["acd_release", "acd_paper"])
def test_the_widths_of_this_file_are_those_of_the_descriptors(name):
    assert len(PRESETS[name].columns) == WIDTHS[name]  # type: ignore[attr-defined]
