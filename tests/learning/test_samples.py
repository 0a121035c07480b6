from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from csm._types import Arrays
from csm.data.prepare import Recipe, prepare_mesh
from csm.data.store import Store
from csm.descriptors import HKS
from csm.descriptors.base import record
from csm.errors import ConfigError
from csm.learning.module import CSMModule
from csm.learning.samples import network_input, recipe_of, shape_sample, stencils_for
from csm.matching.nearest import nearest
from csm.mesh.correspondence import Direction, PointMap
from csm.mesh.shape import Mesh
from csm.operators import Operators
from tests.shapes import blob


def module(**network) -> CSMModule:
    torch.manual_seed(0)
    return CSMModule(network, 5, 162, record(HKS(k=30, n_times=5)), basis_k=20)


def describe_mesh(trained: CSMModule, mesh: Mesh, store: Store) -> torch.Tensor:
    return trained.describe(network_input(prepare_mesh(mesh, recipe_of(trained.hparams), store)))


@dataclass(frozen=True)
class Valence:
    """A stencil for this test: how many edges meet in a vertex, plus a parameter."""

    more: int = 0
    name: ClassVar[str] = "valence"

    def __call__(self, operators: Operators) -> Arrays:
        return {"count": np.bincount(operators.mesh.faces.ravel()) + self.more, "mass": operators.mass}

    def parameters(self) -> dict[str, Any]:
        return {"more": self.more}


def test_arrays_become_tensors_of_the_types_that_networks_take(tmp_path):
    recipe = Recipe(HKS(k=20, n_times=5), 8, (Valence(more=2),))
    features, surface = network_input(prepare_mesh(blob(2), recipe, Store(tmp_path)))
    assert features.shape == (162, 5)
    assert {t.dtype for t in (features, *surface.basis)} == {torch.float32}
    gram = surface.basis.evecs.T @ (surface.basis.mass[:, None] * surface.basis.evecs)
    torch.testing.assert_close(gram, torch.eye(8), atol=1e-4, rtol=0)
    assert surface.basis.mass.sum().item() == pytest.approx(1.0, abs=1e-5)
    tensors = surface.stencil("valence")
    np.testing.assert_array_equal(tensors["count"], np.bincount(blob(2).faces.ravel()) + 2)
    assert (tensors["count"].dtype, tensors["mass"].dtype) == (torch.int64, torch.float32)
    assert tensors["mass"].sum().item() == pytest.approx(1.0), "stencils are of the unit-area copy"


def test_a_mesh_that_was_prepared_without_a_basis_has_one_of_size_0(tmp_path):
    given = network_input(prepare_mesh(blob(2), Recipe(HKS(k=20, n_times=5), 0), Store(tmp_path)))
    assert (given.surface.basis.evals.shape, given.surface.basis.evecs.shape) == ((0,), (162, 0))
    assert given.surface.basis.mass.sum().item() == pytest.approx(1.0, abs=1e-5)


def test_an_input_moves_to_a_device_whole(tmp_path):
    recipe = Recipe(HKS(k=20, n_times=5), 8, (Valence(),))
    moved = network_input(prepare_mesh(blob(2), recipe, Store(tmp_path))).to("meta")
    tensors = [moved.features, *moved.surface.basis, *moved.surface.stencil("valence").values()]
    assert {tensor.device.type for tensor in tensors} == {"meta"}


def test_classes_without_a_vertex_are_left_out_and_labels_may_repeat(tmp_path):
    truth = np.arange(162)
    truth[[3, 5]] = [-1, 4]
    prepared = prepare_mesh(blob(2), Recipe(HKS(k=20, n_times=5), 8), Store(tmp_path))
    sample = shape_sample(prepared, PointMap(truth, Direction.TEMPLATE_TO_SHAPE, 162))
    assert sample.name == "blob"
    assert 3 not in sample.classes
    assert sample.rows[sample.classes == 5].item() == 4
    assert len(sample.rows) == 161


def test_a_network_brings_what_it_wants_to_have_prepared():
    trained = module(name="acscnn", terms=3)
    recipe = recipe_of(trained.hparams)
    assert (recipe.descriptor, recipe.basis_k) == (HKS(k=30, n_times=5), 20)
    assert recipe.stencils == stencils_for({"name": "acscnn", "terms": 3}) != ()
    assert stencils_for({"name": "csmcnn", "ks": 20}) == ()


@pytest.mark.parametrize("network", [{"name": "csmcnn", "ks": 20}, {"name": "acscnn", "terms": 3}])
def test_any_mesh_is_described_with_what_the_network_wants_of_it(tmp_path, network):
    trained, store = module(**network), Store(tmp_path)
    first = describe_mesh(trained, blob(2), store)
    assert first.shape == (162, 256)
    made = store.computed
    assert made == 2 + len(recipe_of(trained.hparams).stencils)
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
