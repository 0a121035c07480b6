from __future__ import annotations

import inspect

import pytest
import torch

from csm.networks import MODELS, NETWORKS, build, registry, settings, stencils_of
from csm.networks.base import CorrespondenceNetwork
from csm.networks.identity import Identity
from csm.operators.stencils import stencil

OPTIONS = {
    "acscnn": ({"alpha": 4.0, "angles": 3, "sweeps": 1}, {"albo": {"alpha": 4.0, "angles": 3, "sweeps": 1}}),
    "chebynet": ({"laplacian": "cotangent"}, {"scaled_laplacian": {"laplacian": "cotangent"}}),
    "csmcnn": ({"ks": 9}, {}),
    "diffusionnet": ({"regularisation": 1e-4}, {"gradients": {"regularisation": 1e-4}}),
    "gcnn": ({"radius": 0.02, "rings": 2, "rays": 4}, {"polar_patches": {"radius": 0.02, "rings": 2, "rays": 4}}),
    "identity": ({"dropout": 0.1}, {}),
    "mgcn": ({"ks": 40, "filters": 8}, {"wavelets": {"k": 40, "n_filters": 8}}),
    "mlp": ({"widths": [5]}, {}),
    "splinecnn": ({"kernel": 3}, {"edge_splines": {"kernel": 3}}),
}


@pytest.mark.parametrize("name", NETWORKS)
def test_a_network_by_name_is_the_one_that_its_class_makes(name):
    options = OPTIONS[name][0]
    torch.manual_seed(0)
    by_name = build(name, 4, 30, **options)
    torch.manual_seed(0)
    by_class = NETWORKS[name](4, 30, **options)
    assert type(by_name) is NETWORKS[name]
    torch.testing.assert_close(by_name.state_dict(), by_class.state_dict(), rtol=0, atol=0)


@pytest.mark.parametrize("name", NETWORKS)
def test_every_option_has_a_default(name):
    _, _, *options = inspect.signature(NETWORKS[name]).parameters.values()
    assert all(p.default is not p.empty and p.kind is p.POSITIONAL_OR_KEYWORD for p in options)


@pytest.mark.parametrize("name", NETWORKS)
def test_stencils_are_those_of_the_network_and_follow_its_options(name):
    options, expected = OPTIONS[name]
    wanted = stencils_of(name, **options)
    assert wanted == build(name, 4, 30, **options).stencils()
    assert wanted.keys() == expected.keys()
    for key, parameters in expected.items():
        assert wanted[key].items() >= parameters.items()


@pytest.mark.parametrize("name", NETWORKS)
def test_stencils_can_be_made_of_every_network_with_its_defaults(name):
    for key, parameters in stencils_of(name).items():
        made = stencil(key, **parameters)
        assert made.parameters().items() >= parameters.items()


@pytest.mark.parametrize("name", NETWORKS)
def test_asking_for_stencils_touches_no_weight_and_no_random_number(name, monkeypatch):
    asked = []
    monkeypatch.setattr(NETWORKS[name], "stencils", lambda net: asked.append(net) or {})
    before = torch.get_rng_state()
    assert stencils_of(name) == {}
    assert torch.equal(torch.get_rng_state(), before)
    (net,) = asked
    assert {tensor.device.type for tensor in net.state_dict().values()} == {"meta"}


@pytest.mark.parametrize("name", NETWORKS)
def test_a_change_of_the_answer_changes_no_network(name):
    net = build(name, 4, 30)
    for parameters in net.stencils().values():
        parameters.clear()
    assert net.stencils() == stencils_of(name)


@pytest.mark.parametrize("name", NETWORKS)
def test_a_misspelt_option_is_refused_with_the_options_that_there_are(name):
    message = rf"network {name} has no option 'droput'; its options are .*dropout"
    with pytest.raises(ValueError, match=message):
        build(name, 4, 30, droput=0.1)
    with pytest.raises(ValueError, match=message):
        stencils_of(name, droput=0.1)


def test_bad_values_are_refused_by_both():
    for ask in (lambda **options: build("chebynet", 4, 30, **options), lambda **o: stencils_of("chebynet", **o)):
        with pytest.raises(ValueError, match="cotangent"):
            ask(laplacian="umbrella")
        with pytest.raises(ValueError, match="network chebynet: "):
            ask(terms="six")


def test_unknown_networks_and_models_are_answered_with_the_known_ones():
    for ask in (lambda: build("nope", 3, 4), lambda: stencils_of("nope")):
        with pytest.raises(ValueError, match=r"no network 'nope'; known are acscnn, .*csmcnn.*, splinecnn"):
            ask()
    with pytest.raises(ValueError, match=r"no model 'nope'; known are .*add_mlp, .*csmcnn, csmcnn_own, csmcnn_paper"):
        settings("nope")


@pytest.mark.parametrize("model", [*MODELS, *NETWORKS])
def test_settings_are_complete_and_make_a_network(model):
    full = settings(model)
    name = full.pop("name")
    _, _, *options = inspect.signature(NETWORKS[name]).parameters
    assert list(full) == options
    assert isinstance(build(name, 4, 30, **full), CorrespondenceNetwork)
    assert not any(isinstance(value, tuple) for value in full.values())


@pytest.mark.parametrize("model", MODELS)
def test_models_say_only_what_differs_from_the_defaults(model):
    name = MODELS[model]["name"]
    defaults = {p.name: p.default for p in inspect.signature(NETWORKS[name]).parameters.values()}
    assert all(value != defaults[option] for option, value in MODELS[model].items() if option != "name")


def test_settings_of_two_models_in_full():
    assert settings("csmcnn_release") == {
        "name": "csmcnn",
        "channels": [64, 64, 64, 128],
        "descriptor_channels": 256,
        "ks": 64,
        "terms": 6,
        "normalisation": "batch",
        "momentum": 1e-3,
        "eps": 1e-3,
        "dropout": 0.5,
        "activation": "relu",
        "bias": "spatial",
    }
    assert settings("add_mlp") == {
        "name": "mlp",
        "widths": [256, 256, 256, 256],
        "normalisation": "batch",
        "momentum": 0.1,
        "eps": 1e-5,
        "dropout": 0.5,
        "activation": "relu",
    }


def test_a_change_of_the_settings_changes_no_model():
    settings("add_mlp")["widths"].clear()
    settings("csmcnn")["channels"].clear()
    assert settings("add_mlp")["widths"] == [256] * 4
    assert settings("csmcnn")["channels"] == [64, 64, 64, 128]


def test_a_network_without_a_named_setting_is_a_setting(monkeypatch):
    class Another(Identity):
        def __init__(self, in_channels: int, n_classes: int, sizes: tuple[int, ...] = (3, 4)) -> None:
            super().__init__(in_channels, n_classes)

    monkeypatch.setitem(registry.NETWORKS, "another", Another)
    assert settings("another") == {"name": "another", "sizes": [3, 4]}
    assert isinstance(build("another", 3, 4), Another)
