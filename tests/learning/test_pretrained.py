from __future__ import annotations

import pytest
import torch

from csm.errors import ConfigError
from csm.learning.module import CSMModule
from csm.learning.pretrained import origin, require_same_trunk, take_over
from tests.learning.toys import NETWORK

HKS = {"name": "hks", "k": 20, "n_times": 7, "scaled": True}


def a_module(n_classes=50, set="a", network=NETWORK, descriptor=HKS, **changes):
    about = {"name": "one", "set": set, "epochs": 3}
    return CSMModule(network, 7, n_classes, descriptor, basis_k=24, training=about, **changes)


@pytest.mark.parametrize(("n_classes", "set", "whole"), [(50, "a", True), (50, "b", False), (60, "a", False)])
def test_the_trunk_is_taken_and_the_classifier_where_the_template_is_the_same(n_classes, set, whole):
    source, module = a_module(), a_module(n_classes, set)
    fresh = module.network.classifier.weight.detach().clone()
    require_same_trunk(module, source, "x")
    assert take_over(module, source) == whole
    torch.testing.assert_close(module.network.embed.weight, source.network.embed.weight, rtol=0, atol=0)
    wanted = source.network.classifier.weight if whole else fresh
    torch.testing.assert_close(module.network.classifier.weight, wanted, rtol=0, atol=0)


def test_the_scale_of_the_input_comes_with_the_layers():
    source, module = a_module(standardise=True), a_module(standardise=True)
    source.inputs.learn([torch.randn(30, 7)])
    take_over(module, source)
    torch.testing.assert_close(module.inputs.deviation, source.inputs.deviation, rtol=0, atol=0)


def test_further_classifiers_are_left_as_they_are():
    source, module = a_module(), a_module(also_classes={"humans": 9})
    before = module.others["humans"].weight.detach().clone()
    assert take_over(module, source)
    torch.testing.assert_close(module.others["humans"].weight, before, rtol=0, atol=0)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"descriptor": HKS | {"k": 30}}, r"its input is another descriptor \(hks; different: k\)"),
        ({"standardise": True}, "learning.standardise is False there"),
        ({"network": NETWORK | {"terms": 5}}, r"the model is another one \(different: terms\)"),
    ],
)
def test_what_does_not_fit_is_refused(changes, message):
    with pytest.raises(ConfigError, match=f"^pretrained=x: {message}"):
        require_same_trunk(a_module(**changes), a_module(), "x")


def test_the_origin_is_remembered():
    assert origin(a_module()) == {"name": "one", "set": "a", "epochs": 3}
