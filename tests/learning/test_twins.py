from __future__ import annotations

import pytest
import torch
from torch import nn

from csm.learning.loading import LightningData
from csm.learning.samples import NetworkInput, also_classes
from csm.learning.twins import learn_twins
from tests.learning.toys import make
from tests.toyset import toy_datamodule

N = 162


@pytest.fixture(scope="module")
def loaded(tmp_path_factory):
    made = LightningData(toy_datamodule(tmp_path_factory.mktemp("twins")))
    made.prepare_data()
    return made


class Sure(nn.Module):
    """A last layer that says which point a vertex is, and in mirror images the point on the other side."""

    def __init__(self, features, other):
        super().__init__()
        self.features, self.other = features, other
        self.classifier = nn.Linear(N, N)
        with torch.no_grad():
            self.classifier.weight.copy_(1e4 * torch.eye(N))

    def describe(self, x, surface):
        image = not torch.equal(x, self.features)
        return torch.eye(N)[self.other] if image else torch.eye(N)


def sure(loaded, other):
    """A module whose network is sure; all its training shapes are the first one."""
    module = make(loaded, places=16, mirror=0.5, also_classes=also_classes(loaded.data, mirror=True))
    sample = loaded.sample(loaded.data.fit_names[0])
    module.places.learn(sample, loaded.data.shape(sample.name).mesh)
    module.network = Sure(sample.features, other)
    return module, sample


def test_the_twin_of_a_point_is_where_it_is_seen_in_mirror_images(loaded):
    other = torch.arange(N).flip(0)
    module, sample = sure(loaded, other)
    assert not module.places.has_twins
    before = module.describe(NetworkInput(sample.features, sample.surface))
    assert learn_twins(module, [sample, sample])
    assert torch.equal(module.places.twins, other)
    after = module.describe(NetworkInput(sample.features, sample.surface))
    torch.testing.assert_close(after, before)  # the mirror image says the same


def test_points_that_no_shape_knows_are_their_own_twins(loaded):
    module, sample = sure(loaded, torch.arange(N).flip(0))
    some = sample._replace(rows=sample.rows[31:131], classes=sample.classes[31:131])
    assert learn_twins(module, [some])
    assert module.places.twins.tolist() == [*range(31), *range(130, 30, -1), *range(131, N)]


def test_a_template_whose_sides_do_not_match_has_no_twins(loaded, caplog):
    module, sample = sure(loaded, torch.zeros(N, dtype=torch.int64))  # all of a mirror image is seen at one point
    mixed = sample._replace(classes=sample.classes[torch.randperm(N)])
    module.places.twins.copy_(torch.arange(N))  # of an earlier training
    with caplog.at_level("INFO"):
        assert not learn_twins(module, [sample, mixed])
    assert not module.places.has_twins
    assert "the template's two sides do not match" in caplog.text
