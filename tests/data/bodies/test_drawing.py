from __future__ import annotations

import numpy as np

from csm.data.bodies.drawing import RANGES, draw_person, draw_pose


def test_people_fill_their_ranges_and_a_seed_repeats_them():
    people = [draw_person(np.random.default_rng([1, k])) for k in range(200)]
    for name, (low, high) in RANGES.items():
        values = np.array([person.phenotype[name] for person in people])
        assert low <= values.min() < low + 0.1 * (high - low)
        assert high - 0.1 * (high - low) < values.max() <= high
    assert draw_person(np.random.default_rng([1, 7])) == people[7]
    heavy = max(people, key=lambda person: person.phenotype["weight"])
    assert heavy.lift > 10


def test_sides_move_by_themselves_and_alike():
    poses = [draw_pose(np.random.default_rng([2, k])).joints() for k in range(400)]
    left = np.array([pose["elbow.L"] for pose in poses])
    right = np.array([pose["elbow.R"] for pose in poses]) * [1, -1, -1]
    assert abs(np.corrcoef(left[:, 2], right[:, 2])[0, 1]) < 0.15
    assert abs(left.mean(axis=0) - right.mean(axis=0)).max() < 6
    assert all((pose["knee.L"][0] >= 0) and (pose["knee.R"][0] >= 0) for pose in poses)  # knees bend one way
