"""Joint angles, and what the skeleton of the parametric body model `anny` (MakeHuman's CC0 assets) makes of them.

Axes of the model: x to the person's left, y to the back, z up; units are metres.  A joint angle is a rotation vector in
degrees in these axes, as they stand in the T-pose and are carried along by the parent bone; the three angles of an arm
are turned one after the other instead: about x (twist), y (lowering), z (to the front).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from csm._types import FloatArray

Angles = dict[str, tuple[float, float, float]]

PHENOTYPES = ("gender", "age", "muscle", "weight", "height", "proportions")
"""What a person is made of; each runs over 0..1 (gender 0 male, 1 female; age 1/3 child, 2/3 young adult, 1 old)."""

LOCAL_SHAPES = (
    "torso-vshape-incr",
    "hip-scale-horiz-incr",
    "measure-shoulder-dist-incr",
    "measure-upperarm-length-incr",
    "measure-upperleg-height-incr",
    "measure-neck-circ-incr",
    "measure-calf-circ-incr",
    "stomach-tone-incr",
    "head-scale-horiz-incr",
    "head-fat-incr",
    "nose-scale-vert-incr",
    "nose-trans-forward",
    "chin-width-incr",
    "chin-prominent-incr",
    "forehead-scale-vert-incr",
    "buttocks-volume-incr",
)
"""Local changes drawn at random per subject, on top of the phenotype."""

BONES = {
    "spine": {"spine05": 0.15, "spine04": 0.2, "spine03": 0.25, "spine02": 0.2, "spine01": 0.2},
    "neck": {"neck01": 0.25, "neck02": 0.2, "neck03": 0.2, "head": 0.35},
    "arm": {"clavicle": 0.12, "shoulder01": 0.18, "upperarm01": 0.7},
    "elbow": {"lowerarm01": 1.0},
    "forearm": {"lowerarm02": 0.6, "wrist": 0.4},
    "wrist": {"wrist": 1.0},
    "hip": {"upperleg01": 0.85, "upperleg02": 0.15},
    "knee": {"lowerleg01": 1.0},
    "ankle": {"foot": 1.0},
    "root": {"root": 1.0},
    "fingers": {f"finger{f}-{k}": 0.8 if k == 1 else 1.0 for f in range(2, 6) for k in range(1, 4)},
    "toes": {"toe1-1": -1.0, "toe2-1": -0.4, "toe3-1": 0.0, "toe4-1": 0.5, "toe5-1": 1.0},
}
"""How the rotation of a joint is shared among the bones of the rig."""


TOE_SPREAD = 7.0
"""Degrees by which the outer toes are turned apart; at rest those of some subjects cut through each other."""


@dataclass(frozen=True)
class Pose:
    """Joint angles of the left side and the middle; `right` overrides the mirror image of the left side."""

    name: str
    left: Angles
    right: Angles | None = None

    def joints(self) -> Angles:
        """Return the angles of all joints, "arm.L", "arm.R", "spine" ..."""
        middle = {k: v for k, v in self.left.items() if k in ("spine", "neck", "root")}
        left = {k: v for k, v in self.left.items() if k not in middle}
        mirrored = {k: (v[0], -v[1], -v[2]) for k, v in left.items()}
        right = mirrored if self.right is None else self.right
        left, right = ({"toes": (0.0, 0.0, s * TOE_SPREAD)} | j for s, j in ((1, left), (-1, right)))
        return middle | {f"{k}.L": v for k, v in left.items()} | {f"{k}.R": v for k, v in right.items()}


def pose_matrices(pose: Pose, extra_lift: float, jitter: FloatArray, rig: Rig) -> FloatArray:
    """Return one 4 x 4 transform per bone as anny's "local-ref" wants them, shape (bones, 4, 4).

    `jitter` (one rotation vector in degrees per joint, shape (>= joints, 3)) makes no two subjects stand alike;
    `extra_lift` holds the hanging arms of broad people away from the trunk (degrees).
    """
    turn = {label: np.eye(3) for label in rig.labels}
    for (joint, angles), noise in zip(sorted(pose.joints().items()), jitter, strict=False):
        base, _, side = joint.partition(".")
        total = np.asarray(angles, float) + noise
        sign = -1.0 if side == "R" else 1.0
        if base == "arm" and sign * total[1] > 20:
            total[1] -= extra_lift * sign
        vector = np.deg2rad(total)
        if base == "arm":
            vector = rotation_vector(
                rotation(vector * (0, 0, 1)) @ rotation(vector * (0, 1, 0)) @ rotation(vector * (1, 0, 0))
            )
        for bone, share in BONES[base].items():
            label = f"{bone}.{side}" if side else bone
            turn[label] = rotation(share * vector) @ turn[label]
    to_t = [t_pose_rotation(label, rig) for label in rig.labels]
    transforms = np.tile(np.eye(4), (len(rig.labels), 1, 1))
    for k, label in enumerate(rig.labels):
        above = to_t[rig.parents[k]] if rig.parents[k] >= 0 else np.eye(3)
        transforms[k, :3, :3] = above.T @ turn[label] @ to_t[k]
    return transforms


@dataclass(frozen=True, eq=False)
class Rig:
    """What poses need of a skeleton: names, parents (-1 for the root), heads in the reference pose (metres)."""

    labels: list[str]
    parents: list[int]
    heads: FloatArray


T_POSE: dict[str, float | tuple[str, str, tuple[float, float, float]] | None] = {
    "clavicle": None,
    "shoulder01": 0.35,
    "upperarm01": ("upperarm01", "lowerarm01", (1.0, 0.0, 0.0)),
    "lowerarm01": ("lowerarm01", "wrist", (1.0, 0.0, 0.0)),
    "upperleg01": ("upperleg01", "foot", (0.0, 0.0, -1.0)),
}
"""Bones that the T-pose turns: the segment (from, to) and where it points on the left side; a number is a share of the
turn of the upper arm.  Every other bone moves with its parent."""


def t_pose_rotation(label: str, rig: Rig) -> FloatArray:
    """Rotation that takes a bone from the model's reference pose to the T-pose, shape (3, 3)."""
    bone, _, side = label.partition(".")
    if bone not in T_POSE:
        parent = rig.parents[rig.labels.index(label)]
        return t_pose_rotation(rig.labels[parent], rig) if parent >= 0 else np.eye(3)
    rule = T_POSE[bone]
    if rule is None:
        return np.eye(3)
    if isinstance(rule, float):
        return rotation(rule * rotation_vector(t_pose_rotation(f"upperarm01.{side}", rig)))
    start, end, target = rule
    segment = rig.heads[rig.labels.index(f"{end}.{side}")] - rig.heads[rig.labels.index(f"{start}.{side}")]
    goal = np.asarray(target) * ((-1.0 if side == "R" else 1.0), 1.0, 1.0)
    return between(segment / np.linalg.norm(segment), goal)


def between(a: FloatArray, b: FloatArray) -> FloatArray:
    """Smallest rotation that takes the unit vector a to the unit vector b, shape (3, 3)."""
    axis = np.cross(a, b)
    sine = np.linalg.norm(axis)
    return rotation(axis / sine * np.arctan2(sine, a @ b))


def rotation_vector(matrix: FloatArray) -> FloatArray:
    """Rotation vector in radians of a rotation by less than half a turn, shape (3,)."""
    axis = np.array([matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]])
    sine = np.linalg.norm(axis) / 2
    vector: FloatArray = axis / (2 * sine) * np.arctan2(sine, (np.trace(matrix) - 1) / 2)
    return vector


def rotation(vector: FloatArray) -> FloatArray:
    """Rotation matrix of a rotation vector in radians (Rodrigues' formula), shape (3, 3)."""
    angle = float(np.linalg.norm(vector))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = vector / angle
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    matrix: FloatArray = np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * (k @ k)
    return matrix
