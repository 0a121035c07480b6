from __future__ import annotations

from csm.descriptors import PRESETS
from csm.studies.bodies import RIVALS
from csm.studies.published import AGE, ASSUMED, SECONDS_AT_6890, SETS, family


def test_every_descriptor_of_the_paper_has_a_preset_and_a_number_for_every_set():
    assert {family(name) for name in RIVALS} == set(AGE)
    assert all(set(row) == set(SETS) for row in AGE.values())


def test_the_paper_ranks_acd_first_everywhere():
    for key in SETS:
        assert min(AGE, key=lambda name: AGE[name][key]) == "acd"
    assert min(SECONDS_AT_6890, key=lambda name: SECONDS_AT_6890[name]) == "acd"


def test_guesses_are_about_families_whose_documentation_speaks_of_a_guess():
    classes = {family(name): type(descriptor) for name, descriptor in PRESETS.items()}
    assert set(ASSUMED) <= set(AGE)
    for name in AGE:
        assert (name in ASSUMED) == ("guess" in str(classes[name].__doc__)), name
