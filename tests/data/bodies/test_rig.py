from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from csm.data.bodies.rig import BONES, Pose, Rig, between, pose_matrices, rotation, rotation_vector

MIDDLE = [bone for joint in ("root", "spine", "neck") for bone in BONES[joint]]
SIDED = list(dict.fromkeys(bone for joint in BONES if joint not in ("root", "spine", "neck") for bone in BONES[joint]))
LABELS = [*MIDDLE, *(f"{bone}.{side}" for bone in SIDED for side in "LR")]
AT = {"upperarm01": (0.2, 0, 1.4), "lowerarm01": (0.4, 0, 1.2), "wrist": (0.6, 0, 1.1), "upperleg01": (0.1, 0, 0.9)}
AT["foot"] = (0.15, 0, 0.1)


def head(label: str) -> tuple[float, float, float]:
    bone, _, side = label.partition(".")
    x, y, z = AT.get(bone, (0, 0, 1))
    return (-x if side == "R" else x), y, z


HEADS = np.array([head(label) for label in LABELS], float)
RIG = Rig(LABELS, [-1] + [0] * (len(LABELS) - 1), HEADS)


def test_rotations_are_those_of_scipy():
    for vector in np.random.default_rng(0).uniform(-1, 1, (20, 3)):
        matrix = rotation(vector)
        np.testing.assert_allclose(matrix, Rotation.from_rotvec(vector).as_matrix(), atol=1e-12)
        np.testing.assert_allclose(rotation_vector(matrix), vector, atol=1e-9)
    np.testing.assert_array_equal(rotation(np.zeros(3)), np.eye(3))


def test_the_smallest_rotation_between_two_directions():
    a, b = np.array([1.0, 0, 0]), np.array([0, 0.6, 0.8])
    assert np.allclose(between(a, b) @ a, b)
    assert np.allclose(between(a, b) @ np.cross(a, b), np.cross(a, b))


@pytest.mark.parametrize("side", ["L", "R"])
def test_a_knee_turns_only_the_lower_leg(side):
    bent = Pose("bent", {"knee": (90, 0, 0)})
    still = Pose("still", {"knee": (0, 0, 0)})
    moved = pose_matrices(bent, 0, np.zeros((20, 3)), RIG) - pose_matrices(still, 0, np.zeros((20, 3)), RIG)
    turned = {LABELS[k] for k in np.flatnonzero(abs(moved).max(axis=(1, 2)) > 1e-9)}
    assert turned == {"lowerleg01.L", "lowerleg01.R"}


def test_the_right_side_mirrors_the_left():
    matrices = pose_matrices(Pose("hip", {"hip": (-40, 20, 10)}), 0, np.zeros((20, 3)), RIG)[:, :3, :3]
    mirror = np.diag([-1.0, 1, 1])
    assert np.allclose(matrices[LABELS.index("upperleg01.R")], mirror @ matrices[LABELS.index("upperleg01.L")] @ mirror)
