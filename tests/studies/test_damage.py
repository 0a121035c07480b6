from __future__ import annotations

from functools import partial

import pytest
import torch

from csm.data.store import Store
from csm.descriptors import preset
from csm.descriptors.base import record
from csm.errors import ConfigError, DataError
from csm.learning.export import export_module
from csm.learning.module import CSMModule
from csm.mesh.perturb import with_noise
from csm.studies import damage
from csm.studies.damage import Contestant, Plan, contestants, damage_rows
from tests.shapes import blob
from tests.studies.toys import toy_bodies, toy_context

PLAN = Plan(n_pairs=2, points=30, distance="edge")


def test_what_was_measured_is_kept_for_its_question_only(tmp_path, monkeypatch):
    context, bodies = toy_context(tmp_path), toy_bodies()
    methods = contestants(["acd_isotropic"], {}, context.store)
    damages = {"none": partial(with_noise, strength=0.0)}
    first = damage_rows(context, bodies, damages, methods, PLAN)

    def never(*_):
        raise AssertionError("it is measured already")

    monkeypatch.setattr(damage, "_measure", never)
    assert damage_rows(context, bodies, damages, methods, PLAN) == first
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


def test_a_trained_network_is_a_method_like_any_other(tmp_path):
    torch.manual_seed(0)
    store = Store(tmp_path / "store")
    network = {"name": "csmcnn", "ks": 16, "channels": [8, 8], "terms": 2}
    module = CSMModule(network, 7, 162, record(preset("acd_isotropic")), basis_k=16)
    path = export_module(module, tmp_path / "export", classifier=True)
    (method,) = contestants([], {"net": str(path)}, store).values()
    assert method.describe(blob(2)).shape == (162, 256)
    module.network.lift.bias.data += 1
    other = contestants([], {"net": str(export_module(module, tmp_path / "other", classifier=True))}, store)["net"]
    assert other.key != method.key


def test_nothing_to_compare_is_an_error(tmp_path):
    with pytest.raises(ConfigError, match="checkpoint"):
        contestants([], {}, Store(tmp_path))
    with pytest.raises(DataError, match="no such checkpoint"):
        contestants([], {"x": str(tmp_path / "x.ckpt")}, Store(tmp_path))
