from __future__ import annotations

import numpy as np
import pytest

from csm.descriptors import ACD, SMWD, WEDS
from csm.errors import ConfigError
from csm.studies import couples
from csm.studies.couples import Task, couple_errors, same_person_couples
from tests.studies.toys import Toys

SETTINGS = [
    ACD(angles=4, k=8, order=3),
    ACD(angles=4, k=12, order=5),
    ACD(angles=8, k=6, order=3),
    ACD(alpha=0.0, angles=1, k=9),
    ACD(alpha=0.0, angles=1, k=5),
]


@pytest.fixture
def task(tmp_path) -> Task:
    return Task(Toys(), ("toy0", "toy1"), tmp_path / "cells", points=30, distance="edge")


def test_each_eigenproblem_is_solved_once_and_the_errors_are_those_of_each_setting_alone(task, monkeypatch):
    shapes = [Toys().load(name) for name in ("toy0", "toy1")]
    alone = [couple_errors(*shapes, [setting], task)[0] for setting in SETTINGS]
    solved: list[int] = []
    solve = couples.Operators._solve
    monkeypatch.setattr(couples.Operators, "_solve", lambda self, m, k: solved.append(k) or solve(self, m, k))
    np.testing.assert_allclose(couple_errors(*shapes, SETTINGS, task), alone)
    # The 4 angles of J=8 between those of J=4 need K=6 only; two shapes.
    assert sorted(solved) == sorted(2 * [6, 6, 6, 6, 9, 12, 12, 12, 12])


def test_matching_a_shape_to_itself_has_no_error(task):
    shape = Toys().load("toy0")
    np.testing.assert_array_equal(couple_errors(shape, shape, SETTINGS[:1], task), [[0, 0]])


def test_errors_go_both_ways(task):
    shapes = [Toys().load(name) for name in ("toy0", "toy1")]
    there = couple_errors(*shapes, SETTINGS, task)
    back = couple_errors(*shapes[::-1], SETTINGS, task)
    assert there.shape == (5, 2)
    assert there.max() > 0
    np.testing.assert_allclose(there, back[:, ::-1])


def test_errors_of_other_meshes_are_not_taken_for_these(task):
    first = task.errors(SETTINGS[:2])
    np.testing.assert_array_equal(task.errors(SETTINGS[:2]), first)
    moved = Task(Toys(("toy1", "toy0", "toy2")), task.couple, task.folder, 30, distance="edge")
    assert moved.path == task.path
    np.testing.assert_allclose(moved.errors(SETTINGS[:2]), first[:, ::-1])


def test_couples_are_two_poses_of_one_training_person():
    names = [str(i) for i in range(100)]
    found = same_person_couples(names, 32, seed=1)
    assert len(found) == 16
    people = [int(a) // 10 for a, b in found]
    assert people == [int(b) // 10 for a, b in found]
    assert sorted(people) == sorted(2 * list(range(8)))
    assert len({name for couple in found for name in couple}) == 32
    assert found[:8] == same_person_couples(names, 16, seed=1)
    for wrong in (0, 3, 82):
        with pytest.raises(ConfigError, match="from 2 to 80"):
            same_person_couples(names, wrong, seed=0)


def test_one_spectrum_serves_all_whatever_they_call_their_number_of_eigenpairs(task, monkeypatch):
    shapes = [Toys().load(name) for name in ("toy0", "toy1")]
    solved: list[int] = []
    solve = couples.Operators._solve
    monkeypatch.setattr(couples.Operators, "_solve", lambda self, m, k: solved.append(k) or solve(self, m, k))
    couple_errors(*shapes, [SMWD(k=20), WEDS(k=20)], task)
    assert solved == [21, 21]
