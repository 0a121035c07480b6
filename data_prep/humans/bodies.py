"""Ten people in ten poses, the built-in humans; what the angles mean is in `csm.data.bodies.rig`."""

from __future__ import annotations

import numpy as np

from csm.data.bodies.rig import Pose

SUBJECTS = np.array(
    [
        # gender age muscle weight height proportions
        [0.00, 0.68, 0.55, 0.45, 0.42, 0.60],
        [1.00, 0.67, 0.45, 0.42, 0.48, 0.65],
        [0.00, 0.76, 0.40, 0.88, 0.38, 0.45],
        [1.00, 0.80, 0.40, 0.84, 0.40, 0.45],
        [0.00, 0.66, 0.85, 0.55, 0.50, 0.75],
        [1.00, 0.94, 0.35, 0.55, 0.38, 0.40],
        [0.05, 0.92, 0.42, 0.38, 0.42, 0.45],
        [0.95, 0.64, 0.62, 0.22, 0.55, 0.70],
        [0.10, 0.52, 0.45, 0.40, 0.40, 0.55],
        [0.90, 0.72, 0.50, 0.58, 0.45, 0.55],
    ]
)
"""One person a row, in the columns of `csm.data.bodies.rig.PHENOTYPES`."""

POSES = (
    Pose("stand", {"arm": (0, 58, 0), "elbow": (0, 0, -15), "hip": (0, -6, 0)}),
    Pose("arms_out", {"arm": (0, 4, 8), "elbow": (0, 0, -6), "hip": (0, -10, 0)}),
    Pose("arms_up", {"arm": (0, -62, -12), "elbow": (0, 0, -22), "hip": (0, -4, 0), "neck": (-12, 0, 0)}),
    Pose(
        "bend_forward",
        {
            "spine": (62, 0, 0),
            "hip": (-28, -9, 0),
            "root": (28, 0, 0),
            "arm": (0, -8, -66),
            "elbow": (0, 0, -12),
            "knee": (8, 0, 0),
            "neck": (10, 0, 0),
        },
    ),
    Pose(
        "twist",
        {
            "spine": (4, 0, 48),
            "neck": (0, 0, 25),
            "arm": (0, 12, 15),
            "elbow": (0, 0, -30),
            "hip": (0, -12, 0),
        },
        {"arm": (0, -16, 35), "elbow": (0, 0, 55), "hip": (0, 12, 0)},
    ),
    Pose(
        "leg_lifted",
        {
            "hip": (-68, -22, 20),
            "knee": (80, 0, 0),
            "ankle": (10, 0, 0),
            "arm": (0, 22, -10),
            "elbow": (0, 0, -20),
            "spine": (4, 0, 0),
        },
        {"hip": (0, 3, 0), "knee": (4, 0, 0), "arm": (0, -10, 20), "elbow": (0, 0, 15)},
    ),
    Pose(
        "arms_crossed",
        {"arm": (0, 36, -66), "elbow": (0, 0, -68), "hip": (0, -7, 0), "neck": (8, 0, 0)},
        {"arm": (0, 6, 72), "elbow": (0, 0, 62), "hip": (0, 7, 0)},
    ),
    Pose(
        "lunge",
        {
            "hip": (-62, -8, 0),
            "knee": (72, 0, 0),
            "ankle": (-8, 0, 0),
            "spine": (10, 0, -12),
            "arm": (0, -30, -25),
            "elbow": (0, 0, -25),
        },
        {"hip": (32, 5, 0), "knee": (22, 0, 0), "ankle": (20, 0, 0), "arm": (0, -42, -20), "elbow": (0, 0, 30)},
    ),
    Pose(
        "squat",
        {
            "root": (18, 0, 0),
            "hip": (-78, -30, 0),
            "knee": (92, 0, 0),
            "ankle": (-22, 0, 0),
            "spine": (20, 0, 0),
            "arm": (0, -22, -70),
            "elbow": (0, 0, -14),
            "neck": (-15, 0, 0),
        },
    ),
    Pose(
        "side_kick",
        {
            "hip": (-8, -52, 0),
            "knee": (12, 0, 0),
            "spine": (0, 26, 0),
            "neck": (0, -10, 10),
            "arm": (0, 40, -25),
            "elbow": (0, 0, -70),
        },
        {"hip": (0, -8, 0), "knee": (6, 0, 0), "arm": (0, 68, 10), "elbow": (0, 0, 50)},
    ),
)
