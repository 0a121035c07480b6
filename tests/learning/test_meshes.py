from __future__ import annotations

import pytest
import torch

from csm.data.store import Store
from csm.descriptors import HKS
from csm.descriptors.base import record
from csm.errors import ConfigError
from csm.learning.meshes import describe_mesh, recipe_of, stencils_for
from csm.learning.module import CSMModule
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


def test_a_network_that_there_is_not_is_an_error_of_the_user():
    with pytest.raises(ConfigError, match="no network"):
        stencils_for({"name": "nope"})
