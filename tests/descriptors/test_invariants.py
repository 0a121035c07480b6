"""What holds for the presets together; families with settings of their own to check do so in their own files."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from csm.descriptors import PRESETS, Descriptor
from tests.descriptors.invariances import CHECKS, mirrored, rigid_motion
from tests.shapes import blob

ACDS = ["acd", "acd_paper", "acd_release", "acd_release_frame"]
LEFT_RIGHT = [*ACDS, "acd_two_bands", "add", "asmwd", "awft", "shot", "xyz"]


def small(name: str) -> Descriptor:
    descriptor = PRESETS[name]
    few = {"k": min(24, descriptor.k)} if hasattr(descriptor, "k") else {}
    made: Descriptor = replace(descriptor, **few)
    return made


@pytest.mark.parametrize("check", CHECKS, ids=lambda c: c.__name__)
@pytest.mark.parametrize(
    "name", ["acd", "acd_paper", "acd_release", "acd_isotropic", "hks", "hks_diffusionnet", "wks", "wks_functional_map"]
)
def test_first_descriptors_pass_the_checks_of_the_others(name, check):
    check(small(name))


def test_the_released_frame_follows_the_world_axes():
    with pytest.raises(AssertionError):
        rigid_motion(small("acd_release_frame"))


@pytest.mark.parametrize("name", list(PRESETS))
def test_only_frames_and_chirality_tell_a_mirror_image(name):
    mesh = blob(3)
    before, after = (small(name)(shape).values for shape in (mesh, mirrored(mesh)))
    change = (np.abs(after - before).max(axis=0) / np.abs(before).max(axis=0).clip(1e-12)).max()
    assert (change > 1e-3) if name in LEFT_RIGHT else (change < 1e-5)
