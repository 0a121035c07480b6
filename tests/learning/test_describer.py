from __future__ import annotations

import copy

import pytest
import torch

from csm.errors import ConfigError
from csm.learning.describer import Describer
from csm.learning.loading import LightningData
from csm.learning.samples import NetworkInput
from csm.learning.smoothing import smoothed
from tests.learning.toys import make_placed
from tests.toyset import toy_datamodule


@pytest.fixture(scope="module")
def loaded(tmp_path_factory):
    made = LightningData(toy_datamodule(tmp_path_factory.mktemp("describer")))
    made.prepare_data()
    return made


@pytest.fixture(scope="module")
def module(loaded):
    made = make_placed(loaded)
    made.inputs.learn([loaded.sample(loaded.data.fit_names[0]).features])
    return made


@pytest.fixture
def given(loaded):
    sample = loaded.sample(loaded.data.fit_names[1])
    return NetworkInput(sample.features, sample.surface)


def test_it_describes_as_the_module_does_that_it_is_made_of(module, given):
    made = Describer.of(module.settings)
    made.load_state_dict({name: x for name, x in module.state_dict().items() if not name.startswith("others.")})
    torch.testing.assert_close(made.describe(given), module.describe(given))
    assert made.settings["training"] == {"name": "toy", "seed": 0}


def test_with_twins_a_shape_is_described_by_the_mean_of_itself_and_its_mirror_image(module, given):
    module, twins = copy.deepcopy(module), torch.randperm(162)
    module.places.twins.copy_(twins)
    columns, head, functions = module.image_columns, module.network.classifier, module.places.functions
    p, q = (
        torch.softmax(head(module.last_layer(NetworkInput(x, given.surface))), 1)
        for x in (given.features, given.features[:, columns])
    )
    mean = p @ functions + q @ functions[twins]
    torch.testing.assert_close(module.describe(given), mean / mean.norm(dim=1, keepdim=True), atol=1e-5, rtol=1e-4)
    assert not torch.allclose(p, q)


def test_a_shape_and_its_mirror_image_are_described_by_twins(module, loaded):
    """What is said of one is what is said of the other with left and right exchanged."""
    module, half = copy.deepcopy(module), torch.randn(81, 16)
    module.places.twins.copy_(torch.arange(162).flip(0))
    module.places.functions.copy_(torch.cat([half, -half.flip(0)]))
    sample = loaded.sample(loaded.data.fit_names[1])
    here = NetworkInput(sample.features, sample.surface)
    there = here._replace(features=sample.features[:, module.image_columns])
    torch.testing.assert_close(module.describe(there), -module.describe(here), atol=1e-5, rtol=1e-4)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"format": 2}, "format 2, this version of csm reads format 1"),
        ({"places": 200}, "the data hold 128 eigenfunctions"),
        ({"network": {"name": "csmcnn", "ks": 300}}, r"wants 300 eigenpairs, the data hold 128"),
        ({"vary": 0.3}, r"set learning\.vary=0 or standardise"),
    ],
)
def test_parameters_that_do_not_fit_are_refused(options, message):
    settings = {"network": {"name": "csmcnn", "ks": 20}, "in_channels": 7, "n_classes": 50, "descriptor": {"name": "x"}}
    with pytest.raises(ConfigError, match=message):
        Describer.of(settings | options)


def test_with_its_mesh_the_places_of_neighbours_are_averaged(module, given, loaded):
    mesh = loaded.data.train_set.load(loaded.data.fit_names[1]).mesh
    alone, found = module.describe(given), module.describe(given, mesh)
    torch.testing.assert_close(found, smoothed(alone, mesh))
    assert not torch.equal(found, alone)
