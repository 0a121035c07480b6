"""Short versions of what `make soak` does for longer: kills, and a store that is removed or damaged in a run."""

from __future__ import annotations

import sys

import pytest

from tests.stress import Filling

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="kills and open files are those of Unix")


@pytest.mark.slow
def test_two_kills_among_three_processes_leave_what_one_alone_makes(tmp_path):
    filling = Filling(tmp_path, 4, seed=1)
    filling.kill(2, processes=3)
    filling.assert_equal_to_undisturbed()


@pytest.mark.slow
@pytest.mark.parametrize("harm", ["remove", pytest.param("damage", marks=pytest.mark.long)])
def test_a_store_that_is_harmed_while_it_is_filled_ends_up_sound(tmp_path, harm):
    filling = Filling(tmp_path, 4, seed=2)
    filling.disturb(getattr(filling, harm), every=0.1)
    filling.run()
    filling.read_all()
    filling.assert_equal_to_undisturbed()
