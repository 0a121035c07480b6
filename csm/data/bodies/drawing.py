"""People and poses drawn at random, far beyond the ten people and ten poses of the built-in humans."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from csm.data.bodies.rig import LOCAL_SHAPES, Angles, Pose

RANGES = {
    "gender": (0.0, 1.0),
    "age": (0.42, 1.0),
    "muscle": (0.1, 0.95),
    "weight": (0.1, 0.95),
    "height": (0.15, 0.85),
    "proportions": (0.2, 0.9),
}
"""Each is drawn uniformly; see `csm.data.bodies.rig.PHENOTYPES`."""

_LOCAL_RANGE = 0.7


@dataclass(frozen=True)
class Person:
    """What a person is made of.

    Parameters
    ----------
    phenotype
        Values of `RANGES`.
    local
        Values of `csm.data.bodies.rig.LOCAL_SHAPES`, -0.7 to 0.7.
    """

    phenotype: dict[str, float]
    local: dict[str, float]

    @property
    def lift(self) -> float:
        """Degrees by which hanging arms are held away from the trunk."""
        return 40.0 * max(0.0, self.phenotype["weight"] - 0.5)


def draw_person(rng: np.random.Generator) -> Person:
    """Return a person drawn at random.

    Examples
    --------
    >>> sorted(draw_person(np.random.default_rng(0)).phenotype)
    ['age', 'gender', 'height', 'muscle', 'proportions', 'weight']
    """
    return Person(
        {name: float(rng.uniform(low, high)) for name, (low, high) in RANGES.items()},
        {name: float(rng.uniform(-_LOCAL_RANGE, _LOCAL_RANGE)) for name in LOCAL_SHAPES},
    )


def draw_pose(rng: np.random.Generator) -> Pose:
    """Return a pose drawn at random: the trunk, and each side by itself.

    Examples
    --------
    >>> pose = draw_pose(np.random.default_rng(0))
    >>> pose.left["arm"] != pose.right["arm"], "arm.L" in pose.joints()
    (True, True)
    """
    bent = rng.random() < 0.35
    trunk: Angles = {
        "spine": (
            float(rng.uniform(-15, 65) if bent else rng.normal(5, 8)),
            float(rng.normal(0, 11)),
            float(rng.normal(0, 18)),
        ),
        "neck": (float(rng.normal(0, 10)), float(rng.normal(0, 8)), float(rng.normal(0, 18))),
    }
    left, right = _side(rng), _side(rng)
    mirrored: Angles = {joint: (x, -y, -z) for joint, (x, y, z) in right.items()}
    return Pose("drawn", trunk | left, mirrored)


def _side(rng: np.random.Generator) -> Angles:
    """Angles of the joints of the left side, within what joints allow."""

    def near(*spread: float) -> tuple[float, float, float]:
        x, y, z = (float(rng.normal(0, s)) for s in spread)
        return x, y, z

    hanging, lifted = rng.random() < 0.4, rng.random() < 0.4
    arm = (rng.normal(0, 15), rng.uniform(30, 66) if hanging else rng.uniform(-65, 55), rng.uniform(-75, 20))
    if hanging:
        arm = (arm[0], arm[1], rng.normal(-5, 12))
    hip = (
        rng.uniform(-85, 30) if lifted else rng.normal(-4, 8),
        rng.uniform(-40, -2) if lifted else rng.normal(-8, 5),
        rng.normal(0, 10),
    )
    knee = rng.uniform(0, 105) if lifted else abs(rng.normal(0, 12))
    curl = rng.uniform(0, 55) if rng.random() < 0.4 else rng.uniform(-5, 15)
    return {
        "arm": (float(arm[0]), float(arm[1]), float(arm[2])),
        "elbow": (
            0.0,
            float(rng.normal(0, 8)),
            -float(rng.uniform(0, 110) if rng.random() < 0.6 else rng.uniform(0, 25)),
        ),
        "forearm": (float(rng.normal(0, 25)), 0.0, 0.0),
        "wrist": near(5, 14, 12),
        "fingers": (0.0, float(curl), 0.0),
        "hip": (float(hip[0]), float(hip[1]), float(hip[2])),
        "knee": (float(knee), 0.0, 0.0),
        "ankle": near(11, 6, 6),
    }
