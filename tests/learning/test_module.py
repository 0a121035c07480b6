from __future__ import annotations

import inspect

import numpy as np
import pytest
import torch
import torch.nn.functional as F
from lightning.fabric.utilities.apply_func import move_data_to_device

from csm.descriptors import ACD, Coordinates
from csm.descriptors.base import record
from csm.errors import ConfigError
from csm.learning.loading import LightningData
from csm.learning.module import CSMModule, random_rotation
from csm.learning.samples import NetworkInput, also_classes, stencils_for
from csm.matching.nearest import nearest
from csm.networks import NETWORKS
from tests.learning.toys import make, train
from tests.toyset import toy_datamodule


@pytest.fixture(scope="module")
def loaded(tmp_path_factory):
    made = LightningData(toy_datamodule(tmp_path_factory.mktemp("learn")))
    made.prepare_data()
    return made


def test_training_learns_to_match(loaded, tmp_path):
    module = make(loaded)
    trainer = train(module, loaded, tmp_path, 40)
    a, b = (given(loaded.sample(name)) for name in loaded.data.fit_names[:2])
    exact = (nearest(module.describe(a), module.describe(b)) == np.arange(162)).mean()
    assert exact > 0.8
    assert trainer.callback_metrics["train/loss"] < 1.0


def given(sample) -> NetworkInput:
    return NetworkInput(sample.features, sample.surface)


def test_a_description_is_made_in_evaluation_mode_and_without_gradients(loaded):
    module, sample = make(loaded, network={"dropout": 0.5}), next(iter(loaded.val_dataloader()))
    first = module.train().describe(given(sample))
    assert not first.requires_grad
    torch.testing.assert_close(module.describe(given(sample)), first)
    assert not module.training


def test_the_loss_is_the_cross_entropy_of_the_labelled_rows(loaded):
    module = make(loaded)
    sample = next(iter(loaded.val_dataloader()))
    module.eval()
    logits = module.network(sample.features, sample.surface)[sample.rows]
    expected = F.cross_entropy(logits, sample.classes)
    torch.testing.assert_close(module.loss(module(sample.features, sample.surface), sample), expected)


def test_the_loss_of_drawn_rows_is_that_of_all_rows_on_average(loaded):
    sample = next(iter(loaded.val_dataloader()))
    module, full = make(loaded, loss_rows=20), make(loaded)
    with torch.no_grad():
        x = module.eval()(sample.features, sample.surface)
        assert module.loss(x, sample) == full.eval().loss(x, sample)  # a test of the network takes them all
        module.train()
        draws = torch.stack([module.loss(x, sample) for _ in range(400)])
    assert draws.std() > 0
    assert abs(draws.mean() - full.loss(x, sample)) < 5 * draws.std() / 20


def test_rotations_are_proper_and_point_everywhere():
    torch.manual_seed(0)
    drawn = torch.stack([random_rotation() for _ in range(2000)])
    torch.testing.assert_close(drawn @ drawn.mT, torch.eye(3).double().expand(2000, 3, 3))
    assert torch.linalg.det(drawn).min() > 0.99
    assert drawn.mean(0).abs().max() < 0.06  # the standard error of an entry is 0.013
    torch.testing.assert_close(drawn.square().mean(0), torch.full((3, 3), 1 / 3).double(), atol=0.03, rtol=0)


def test_positions_are_turned_in_training_only(tmp_path):
    loaded = LightningData(toy_datamodule(tmp_path, descriptor=Coordinates()))
    loaded.prepare_data()
    module, sample = make(loaded, rotate=True), next(iter(loaded.val_dataloader()))
    seen: list[torch.Tensor] = []
    describe = module.network.describe
    module.network.describe = lambda x, surface: (seen.append(x), describe(x, surface))[1]
    module.log = lambda *_, **__: None
    module.training_step(sample)
    module.validation_step(sample)
    turned, plain = seen
    assert torch.equal(plain, sample.features)
    assert (turned - plain).abs().max() > 0.1
    torch.testing.assert_close(turned @ turned.T, plain @ plain.T, atol=1e-5, rtol=0)


def test_what_does_not_turn_with_the_shape_is_not_turned(loaded):
    with pytest.raises(ConfigError, match="descriptor=xyz"):
        make(loaded, rotate=True)


@pytest.mark.parametrize(
    ("schedule", "last"), [("cosine", 0.0), ("step", 0.125e-2), ("drop", 1e-3), ("one_cycle", 4e-8), ("constant", 1e-2)]
)
def test_schedules_end_where_they_should(loaded, tmp_path, schedule, last):
    trainer = train(make(loaded, schedule=schedule), loaded, tmp_path, 3, limit_val_batches=0)
    assert trainer.optimizers[0].param_groups[0]["lr"] == pytest.approx(last, rel=0.3, abs=1e-5)


def test_unknown_names_are_errors_of_the_user(loaded):
    with pytest.raises(ConfigError, match=r"known are .*csmcnn"):
        make(loaded, network={"name": "transformer"})
    with pytest.raises(ConfigError, match="format 99"):
        make(loaded, format=99)
    with pytest.raises(ConfigError, match="loss_rows=0"):
        make(loaded, loss_rows=0)


def test_the_same_seed_gives_the_same_network(loaded, tmp_path):
    weights = []
    for run in range(2):
        module = make(loaded)
        train(module, loaded, tmp_path / str(run), 2, limit_val_batches=0)
        weights.append(module.network.embed.weight.detach().clone())
    torch.testing.assert_close(*weights)


def test_shapes_of_another_template_train_the_same_descriptor_through_a_classifier_of_their_own(loaded, tmp_path):
    module = make(loaded, also_classes={"others": 50})
    sample = next(iter(loaded.val_dataloader()))._replace(template="others")
    sample = sample._replace(rows=sample.rows[:50], classes=torch.arange(50))
    module.loss(module(sample.features, sample.surface), sample).backward()
    assert module.classifier("others").weight.grad is not None
    assert module.network.classifier.weight.grad is None
    assert all(p.grad is not None for p in module.network.embed.parameters())


@pytest.fixture(scope="module")
def of_all_networks(tmp_path_factory):
    """Prepared shapes with what every network asks for."""
    wanted = {s.name: s for name in NETWORKS for s in stencils_for({"name": name, **options_of(name)})}
    made = LightningData(toy_datamodule(tmp_path_factory.mktemp("all"), stencils=tuple(wanted.values())))
    made.prepare_data()
    return made


def options_of(name: str) -> dict[str, object]:
    return {"ks": 20} if "ks" in inspect.signature(NETWORKS[name]).parameters else {}


def module_of(name: str, loaded: LightningData, **options: object) -> CSMModule:
    torch.manual_seed(0)
    network = {"name": name, **options_of(name), "dropout": 0.0}
    return CSMModule(network, loaded.n_features, 162, record(loaded.data.recipe.descriptor), basis_k=24, **options)


@pytest.mark.parametrize("name", NETWORKS)
def test_every_network_trains_with_mixed_precision(of_all_networks, tmp_path, name):
    losses = []
    for precision in ("32-true", "bf16-mixed"):
        module = module_of(name, of_all_networks, lr=1e-3)
        trainer = train(module, of_all_networks, tmp_path, 2, precision=precision, enable_checkpointing=False)
        losses.append(float(trainer.callback_metrics["train/loss"]))
        assert all(x.dtype == torch.float32 for x in module.parameters())
    assert losses[1] == pytest.approx(losses[0], rel=0.02)


NOT_ON_META = {"acscnn", "chebynet", "gcnn"}  # no sparse tensors without storage; GCNN asks where its chunks begin


@pytest.mark.parametrize("name", sorted({*NETWORKS} - NOT_ON_META))
def test_a_training_step_never_waits_for_the_device(of_all_networks, name):
    """Tensors of the device "meta" have no values: whoever asks for one, as .item() does, raises an error."""
    module = module_of(name, of_all_networks, loss_rows=20).to("meta").train()
    module.log = lambda *_, **__: None
    sample = move_data_to_device(of_all_networks.sample("toy0"), torch.device("meta"))
    assert sample.features.device.type == sample.surface.basis.evecs.device.type == "meta"
    module.training_step(sample).backward()
    assert module.network.classifier.weight.grad.device.type == "meta"


def test_the_input_is_varied_in_training_only_and_only_where_it_is_standardised(loaded):
    module, sample = make(loaded, standardise=True, vary=0.3), next(iter(loaded.val_dataloader()))
    module.eval()
    still = module(sample.features, sample.surface)
    torch.testing.assert_close(module(sample.features, sample.surface), still)
    module.train()
    assert not torch.allclose(module(sample.features, sample.surface), still)
    with pytest.raises(ConfigError, match=r"set learning\.vary=0 or standardise"):
        make(loaded, vary=0.3)


def test_places_are_what_a_network_describes_by(loaded):
    module, sample = make(loaded, places=16), loaded.sample(loaded.data.fit_names[0])
    module.places.learn(sample, loaded.data.shape(sample.name).mesh)
    found = module.describe(given(sample))
    last = module.last_layer(given(sample))
    torch.testing.assert_close(found, module.places(last, module.network.classifier))
    assert found.shape == (162, 16)
    with pytest.raises(ConfigError, match="the data hold 24 eigenfunctions"):
        make(loaded, places=25)


def test_half_of_the_steps_see_a_mirror_image_whose_labels_have_a_classifier_of_their_own(loaded, tmp_path):
    module = make(loaded, mirror=0.5, also_classes=also_classes(loaded.data, mirror=True))
    assert module.hparams["also_classes"] == {"mirrored": 162}
    sample = loaded.sample(loaded.data.fit_names[0])
    seen = [module._seen(sample) for _ in range(200)]
    images = [each for each in seen if each.template == "mirrored"]
    assert 60 < len(images) < 140
    order = ACD(angles=4, k=8, order=3, cuts=1).mirrored_columns()
    assert torch.equal(images[0].features, sample.features[:, order])
    before = module.others["mirrored"].weight.detach().clone()
    train(module, loaded, tmp_path, 2)
    assert not torch.equal(module.others["mirrored"].weight, before)


@pytest.mark.parametrize(
    ("mirror", "descriptor", "message"),
    [
        (0.5, record(Coordinates()), r"xyz: it is not known how its columns change .*; set learning\.mirror=0"),
        (1, record(ACD(angles=4, k=8)), "mirror=1; wanted a share of the steps, from 0 to below 1"),
        ("x", record(ACD(angles=4, k=8)), "mirror=x; wanted a share"),
        (float("nan"), record(ACD(angles=4, k=8)), "wanted a share of the steps"),
    ],
)
def test_what_cannot_be_mirrored_is_an_error(mirror, descriptor, message):
    with pytest.raises(ConfigError, match=message):
        CSMModule({"name": "mlp"}, 3, 5, descriptor, mirror=mirror)


def test_a_network_that_sees_more_than_the_descriptor_has_no_mirror_images():
    with pytest.raises(ConfigError, match="diffusionnet sees more of a shape than its descriptor"):
        CSMModule({"name": "diffusionnet"}, 48, 5, record(ACD(angles=4, k=8)), mirror=0.5)
