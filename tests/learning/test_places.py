from __future__ import annotations

import pytest
import torch
from torch import nn

from csm.data.prepare import Recipe, prepare_mesh
from csm.data.store import Store
from csm.descriptors import HKS
from csm.learning.places import Places, template_of
from csm.learning.samples import shape_sample
from csm.mesh.correspondence import PointMap
from tests.shapes import blob


@pytest.fixture
def sample(tmp_path):
    prepared = prepare_mesh(blob(), Recipe(HKS(k=20), 12), Store(tmp_path))
    return shape_sample(prepared, PointMap.identity(162))


def test_a_place_is_the_mean_of_the_eigenfunctions_over_the_probable_points(sample):
    places, classifier = Places(162, 8), nn.Linear(5, 162)
    places.learn(sample, blob())
    last = torch.randn(30, 5)
    p = torch.softmax(last.double() @ classifier.weight.double().T + classifier.bias.double(), 1)
    mean = torch.stack([sum(p[x, c] * places.functions[c].double() for c in range(162)) for x in range(30)])
    wanted = mean / mean.norm(dim=1, keepdim=True)
    torch.testing.assert_close(places(last, classifier, block=7).double(), wanted, atol=1e-5, rtol=1e-4)


def test_a_vertex_that_is_surely_a_point_has_its_row(sample):
    places, classifier = Places(162, 8), nn.Linear(162, 162)
    places.learn(sample, blob())
    with torch.no_grad():
        classifier.weight.copy_(1e4 * torch.eye(162))
    found = places(torch.eye(162), classifier)
    rows = sample.surface.basis.evecs[:162, :8]
    torch.testing.assert_close(found, rows / rows.norm(dim=1, keepdim=True))


def test_points_that_a_shape_lacks_do_not_count(sample):
    places = Places(200, 8)
    places.learn(sample._replace(rows=sample.rows[:100], classes=sample.classes[:100]), blob())
    assert places.functions[:100].abs().sum(1).min() > 0
    assert places.functions[100:].abs().max() == 0


def test_a_reading_has_the_surface_too_and_its_twins_the_other_side(sample):
    places, classifier = Places(162, 8), nn.Linear(5, 162)
    places.learn(sample, blob())
    assert not places.has_twins
    places.twins.copy_(torch.arange(162).flip(0))
    assert places.has_twins
    last = torch.randn(30, 5)
    p = torch.softmax(classifier(last), 1)
    for twins, order in ((False, slice(None)), (True, places.twins)):
        found = places.read(last, classifier, twins=twins, block=7)
        for got, table in zip(found, (places.functions, places.points, places.normals), strict=True):
            torch.testing.assert_close(got, p @ table[order], atol=1e-5, rtol=1e-4)
    torch.testing.assert_close(places.points.double(), torch.as_tensor(centred(blob())[:162]), atol=1e-6, rtol=0)
    torch.testing.assert_close(places.normals.double(), torch.as_tensor(blob().vertex_normals[:162]), atol=1e-6, rtol=0)


def centred(mesh):
    return (mesh.vertices - mesh.vertices.mean(0)) / mesh.area**0.5


def test_the_weights_of_an_older_network_have_eigenfunctions_alone(sample):
    places = Places(162, 8)
    places.learn(sample, blob())
    old = {"functions": places.functions}
    made = Places(162, 8)
    made.load_state_dict(old)
    assert not made.has_twins
    assert torch.equal(made.functions, places.functions)


def test_more_eigenfunctions_than_there_are_is_an_error(sample):
    with pytest.raises(ValueError, match="wanted 13 eigenfunctions of the template, and the data hold 12"):
        Places(162, 13).learn(sample, blob())
    with pytest.raises(ValueError, match="2 or more"):
        Places(162, 1)


def test_the_shape_that_knows_most_points_stands_for_the_template(sample, caplog):
    fewer = sample._replace(name="fewer", rows=sample.rows[:100], classes=sample.classes[:100])
    assert template_of([fewer, sample]) is sample
    assert not caplog.records
    other = sample._replace(name="other", rows=sample.rows[90:], classes=sample.classes[90:])
    assert template_of([fewer, other]).name == "fewer"
    assert "fewer stands for the template, and lacks 62 of the points" in caplog.text


def test_rows_of_any_precision_and_none_at_all_have_places(sample):
    places, classifier = Places(162, 8), nn.Linear(5, 162)
    places.learn(sample, blob())
    assert places(torch.zeros(0, 5), classifier).shape == (0, 8)
    assert places(torch.zeros(3, 5, dtype=torch.float16), classifier).dtype == torch.float32
