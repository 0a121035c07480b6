from __future__ import annotations

import pytest

from csm.descriptors.presets import PRESETS, preset
from csm.networks import build
from csm.studies.contenders import CONTENDERS

COUNTS = {
    "splinecnn": 4_114_186,
    "acscnn": 4_803_178,
    "mgcn": 2_848_234,
    "csmcnn": 1_906_602,
    "diffusionnet": 1_351_786,
}
"""At 6890 classes, from the publications' code."""
WIDTHS = {"acd_release": 48, "weds": 128, "constant": 1, "hks_diffusionnet": 16, "acd_paper": 140, "add": 256}


@pytest.mark.parametrize("name", CONTENDERS)
def test_every_contender_can_be_built_and_has_its_published_size(name):
    contender = CONTENDERS[name]
    assert contender.descriptor in PRESETS
    network = build(contender.network, WIDTHS[contender.descriptor], 6890, **contender.options)
    assert sum(p.numel() for p in network.parameters()) == COUNTS.get(name, pytest.approx(1.9e6, rel=0.2))


@pytest.mark.parametrize("name", ["acd_release", "acd_paper"])
def test_the_widths_of_this_file_are_those_of_the_descriptors(name):
    assert len(preset(name).columns) == WIDTHS[name]  # type: ignore[attr-defined]
