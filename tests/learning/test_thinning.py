from __future__ import annotations

import copy

import numpy as np
import pytest
import torch
from safetensors.torch import load_file, save_file

from csm.errors import ConfigError, DataError
from csm.learning.checkpoint import export_module, load_module
from csm.learning.loading import LightningData
from csm.learning.samples import NetworkInput
from csm.learning.thinning import thinned
from csm.matching.network import load_model
from tests.learning.toys import make, make_placed
from tests.toyset import toy_datamodule


@pytest.fixture(scope="module")
def loaded(tmp_path_factory):
    made = LightningData(toy_datamodule(tmp_path_factory.mktemp("thin")))
    made.prepare_data()
    return made


@pytest.fixture(scope="module")
def module(loaded):
    return make_placed(loaded)


def described(network, loaded):
    sample = loaded.sample(loaded.data.fit_names[1])
    return network.describe(NetworkInput(sample.features, sample.surface))


def test_all_points_and_functions_give_the_same_descriptor(module, loaded):
    same = thinned(module, np.arange(162), 16)
    torch.testing.assert_close(described(same, loaded), described(module, loaded))
    assert not any(name.startswith("others.") for name in same.state_dict())


def test_some_points_share_the_probability(module, loaded):
    kept = np.arange(0, 162, 3)
    sample = loaded.sample(loaded.data.fit_names[1])
    last = module.last_layer(NetworkInput(sample.features, sample.surface))
    p = torch.softmax(module.network.classifier(last)[:, kept], 1) @ module.places.functions[kept, :5]
    found = described(thinned(module, kept, 5), loaded)
    torch.testing.assert_close(found, p / p.norm(dim=1, keepdim=True), atol=1e-5, rtol=1e-4)


def test_twins_are_the_nearest_of_the_points_that_are_left(module, loaded):
    paired = copy.deepcopy(module)
    paired.places.twins.copy_(torch.arange(162).flip(0))
    same = thinned(paired, np.arange(162), 16)
    assert same.places.twins.tolist() == list(range(162))[::-1]
    torch.testing.assert_close(described(same, loaded), described(paired, loaded))
    kept = np.arange(0, 162, 3)
    rows = torch.nn.functional.normalize(module.places.functions, dim=1)
    wanted = [int((rows[161 - i] @ rows[kept].T).argmax()) for i in kept]
    assert thinned(paired, kept, 5).places.twins.tolist() == wanted


def test_half_precision_changes_little_and_halves_the_file(module, loaded, tmp_path):
    small = thinned(module, np.arange(0, 162, 2), 8)
    sizes = {}
    for half in (False, True):
        made = load_module(export_module(small, tmp_path / str(half), half=half))
        torch.testing.assert_close(described(made, loaded), described(small, loaded), atol=1e-2, rtol=0)
        sizes[half] = (tmp_path / str(half) / "model.safetensors").stat().st_size
    assert sizes[True] < 0.65 * sizes[False]


@pytest.mark.parametrize(("classes", "functions"), [([0, 162], 8), ([], 8), ([1, 2], 17), ([1, 2], 1), ([3, 3], 8)])
def test_what_is_not_there_cannot_be_kept(module, classes, functions):
    with pytest.raises(ConfigError, match="wanted some of 162 points"):
        thinned(module, np.array(classes, dtype=np.int64), functions)


def test_a_network_that_describes_by_its_last_layer_needs_all_points(loaded):
    with pytest.raises(ConfigError, match=r"trained with learning\.places"):
        thinned(make(loaded), np.arange(9), 4)


def test_an_export_has_one_key_and_needs_its_classifier(module, tmp_path):
    file = export_module(module, tmp_path)
    assert load_model(file).key == load_model(file).key
    weights = load_file(tmp_path / "model.safetensors")
    assert not any(name.startswith("others.") for name in weights)
    save_file({k: x for k, x in weights.items() if not k.startswith("classifier.")}, tmp_path / "model.safetensors")
    with pytest.raises(DataError, match=r"they differ in classifier\.bias"):
        load_module(file)


@pytest.mark.parametrize("twins", [torch.full((162,), 162), torch.cat([torch.tensor([-1]), torch.arange(161)])])
def test_twins_that_are_no_points_of_the_template_are_refused(module, tmp_path, twins):
    changed = copy.deepcopy(module)
    changed.places.twins.copy_(twins)
    with pytest.raises(DataError, match=r"model\.json: the weights are damaged.*places\.twins does not hold"):
        load_module(export_module(changed, tmp_path))


def test_numbers_that_half_precision_cannot_hold_are_refused(loaded, tmp_path):
    large = make(loaded)
    with torch.no_grad():
        large.network.lift.weight[0, 0] = 1e5
    with pytest.raises(ConfigError, match=r"lift\.weight has numbers that half precision cannot hold"):
        export_module(large, tmp_path, half=True)
