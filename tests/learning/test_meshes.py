from __future__ import annotations

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from csm.data.store import Store
from csm.descriptors import HKS
from csm.descriptors.base import record
from csm.errors import ConfigError
from csm.evaluation.matching import nearest
from csm.learning.meshes import describe_mesh, recipe_of, stencils_for
from csm.learning.module import CSMModule
from csm.mesh.shape import Mesh
from tests.shapes import blob


def module(**network) -> CSMModule:
    torch.manual_seed(0)
    return CSMModule(network, 5, 162, record(HKS(k=30, n_times=5)), basis_k=20)


@pytest.mark.parametrize("network", [{"name": "csmcnn", "ks": 20}, {"name": "acscnn", "terms": 3}])
def test_any_mesh_is_described_with_what_the_network_wants_of_it(tmp_path, network):
    trained, store = module(**network), Store(tmp_path)
    first = describe_mesh(trained, blob(2), store)
    assert first.shape == (162, 256)
    made = store.computed
    assert made == 2 + len(recipe_of(trained).stencils)
    torch.testing.assert_close(describe_mesh(trained, blob(2), store), first)
    assert store.computed == made


def turned_and_scaled(mesh: Mesh, seed: int) -> Mesh:
    rng = np.random.default_rng(seed)
    turn = Rotation.random(random_state=seed).as_matrix()
    return Mesh(rng.uniform(0.1, 10) * mesh.vertices @ turn.T + rng.normal(size=3), mesh.faces, mesh.name)


INVARIANT = [
    {"name": "csmcnn", "ks": 20},
    {"name": "mlp"},
    {"name": "chebynet"},
    {"name": "acscnn", "terms": 3},
    {"name": "mgcn", "ks": 20, "filters": 8, "tolerance": 0.0},
    {"name": "diffusionnet", "ks": 20, "width": 16},
]


@pytest.mark.parametrize("network", INVARIANT, ids=lambda network: network["name"])
@pytest.mark.parametrize("seed", [0, 1])
def test_where_a_shape_stands_and_how_large_it_is_changes_no_match(tmp_path, network, seed):
    trained, store = module(**network), Store(tmp_path)
    here, there = blob(3), turned_and_scaled(blob(3), seed)
    before, after = (describe_mesh(trained, mesh, store) for mesh in (here, there))
    torch.testing.assert_close(after, before, rtol=2e-3, atol=2e-3 * float(before.abs().max()))
    matches = nearest(before, after)
    assert (matches == np.arange(here.n_vertices)).mean() > 0.99


def test_splinecnn_sees_directions_in_space_but_neither_size_nor_place(tmp_path):
    trained, store, mesh = module(name="splinecnn"), Store(tmp_path), blob(3)
    first = describe_mesh(trained, mesh, store)
    moved = Mesh(7 * mesh.vertices + 1, mesh.faces, "moved")
    torch.testing.assert_close(describe_mesh(trained, moved, store), first, rtol=1e-3, atol=1e-4)
    turned = describe_mesh(trained, turned_and_scaled(mesh, 0), store)
    assert float((turned - first).abs().max()) > 0.05 * float(first.abs().max())


def test_a_network_that_there_is_not_is_an_error_of_the_user():
    with pytest.raises(ConfigError, match="no network"):
        stencils_for({"name": "nope"})
