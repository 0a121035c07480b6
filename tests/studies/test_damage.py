from __future__ import annotations

from functools import partial

import pytest
import torch

from csm.mesh.perturb import with_noise
from csm.studies import damage
from csm.studies.contestants import Contestant, contestants
from csm.studies.damage import Plan, damage_rows
from tests.studies.toys import toy_bodies, toy_context

PLAN = Plan(n_pairs=2, points=30, distance="edge")


def test_what_was_measured_is_kept_for_its_question_only(tmp_path, monkeypatch):
    context, bodies = toy_context(tmp_path), toy_bodies()
    methods = contestants(["acd_isotropic"], {}, context, bodies)
    damages = {"none": partial(with_noise, strength=0.0)}
    first = damage_rows(context, bodies, damages, methods, PLAN)

    def never(*_):
        raise AssertionError("it is measured already")

    monkeypatch.setattr(damage, "_measure", never)
    assert damage_rows(context, bodies, damages, methods, PLAN) == first
    monkeypatch.undo()
    more = damages | {"noise": partial(with_noise, strength=0.5)}
    assert damage_rows(context, bodies, more, methods, PLAN)[0] == first[0]
    alone = damage_rows(toy_context(tmp_path / "alone"), bodies, more, methods, PLAN)
    assert damage_rows(context, bodies, more, methods, PLAN) == alone
    monkeypatch.setattr(damage, "_measure", never)
    with pytest.raises(AssertionError):
        damage_rows(context, bodies, damages, methods, Plan(n_pairs=2, points=31, distance="edge"))


def test_the_positions_of_undamaged_copies_match_themselves(tmp_path):
    """A perfect descriptor has no error whatever is cut away, as errors are measured on the whole target."""
    bodies = toy_bodies()
    known = {}

    def number_of_vertex(mesh):
        for name in bodies.original.names:
            for row in bodies.original.load(name).mesh.vertices.tolist():
                known.setdefault(tuple(row), len(known) % bodies.original.load(name).mesh.n_vertices)
        return torch.tensor([[float(known[tuple(row)])] for row in mesh.vertices.tolist()])

    oracle = Contestant("oracle", number_of_vertex)
    (row,) = damage_rows(toy_context(tmp_path), bodies, {"cut": lambda m: damage_of(m)}, {"oracle": oracle}, PLAN)
    assert (row["error"], row["exact %"]) == (0, 100)
    assert row["vertices left"] < 0.95


def damage_of(mesh):
    from csm.studies.figure13 import cut_extremity

    return cut_extremity(mesh, 0.15)
