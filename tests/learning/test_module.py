from __future__ import annotations

import pytest
import torch
import torch.nn.functional as F
from lightning import Trainer

from csm.descriptors import Coordinates
from csm.errors import ConfigError, DataError
from csm.evaluation.matching import nearest
from csm.learning.callbacks import EpochLines, ValidationErrors
from csm.learning.export import load_module
from csm.learning.module import CSMModule, random_rotation
from tests.toyset import toy_datamodule

NETWORK = {"name": "csmcnn", "channels": [16, 16, 16], "descriptor_channels": 24, "ks": 20, "terms": 4, "dropout": 0.0}


def make(datamodule, **options) -> CSMModule:
    descriptor = datamodule.recipe.descriptor
    settings = {"lr": 1e-2, "basis_k": 24, "training": {"name": "toy", "seed": 0}} | options
    torch.manual_seed(0)
    return CSMModule(
        NETWORK | settings.pop("network", {}),
        datamodule.n_features,
        datamodule.n_classes,
        {"name": descriptor.name, **descriptor.parameters()},
        **settings,
    )


def train(module, datamodule, folder, epochs=12, **options) -> Trainer:
    settings = {
        "max_epochs": epochs,
        "default_root_dir": folder,
        "accelerator": "cpu",
        "logger": False,
        "enable_progress_bar": False,
        "enable_model_summary": False,
        "num_sanity_val_steps": 0,
    }
    trainer = Trainer(**(settings | options))
    trainer.fit(module, datamodule=datamodule)
    return trainer


@pytest.fixture(scope="module")
def datamodule(tmp_path_factory):
    made = toy_datamodule(tmp_path_factory.mktemp("learn"))
    made.prepare_data()
    return made


@pytest.fixture(scope="module")
def trained(datamodule, tmp_path_factory):
    module = make(datamodule)
    folder = tmp_path_factory.mktemp("run")
    trainer = train(module, datamodule, folder, 60, callbacks=[ValidationErrors(pairs=4, points=100)])
    trainer.save_checkpoint(folder / "model.ckpt")
    return module, trainer, folder / "model.ckpt"


def test_training_learns_to_match_and_logs_the_validation_error(trained, datamodule):
    module, trainer, _ = trained
    a, b = (datamodule.load(datamodule.train_set, name).sample for name in datamodule.fit_names[:2])
    exact = (nearest(module.describe(a), module.describe(b)) == range(162)).mean()
    assert exact > 0.8
    assert trainer.callback_metrics["val/age"] < 0.05
    assert trainer.callback_metrics["val/exact"] > 0.7
    assert trainer.callback_metrics["train/loss"] < 1.0


def test_a_line_per_epoch_shows_the_numbers_of_the_bar(datamodule, tmp_path, capsys):
    callbacks = [ValidationErrors(pairs=2, points=20), EpochLines()]
    trainer = train(make(datamodule), datamodule, tmp_path, 3, callbacks=callbacks, check_val_every_n_epoch=2)
    said = capsys.readouterr()
    lines = [line for line in said.out.splitlines() if line.startswith("epoch")]
    assert [line.partition(":")[0] for line in lines] == ["epoch 1 of 3", "epoch 2 of 3", "epoch 3 of 3"]
    assert ["val/age" in line for line in lines] == [False, True, False]
    assert lines[2].endswith(f"train/loss {trainer.callback_metrics['train/loss']:.4g}")
    assert "\r" not in said.out + said.err


def test_the_loss_is_the_cross_entropy_of_the_labelled_rows(datamodule):
    module = make(datamodule)
    sample = next(iter(datamodule.val_dataloader()))
    module.eval()
    logits = module.network(sample.features, sample.surface)[sample.rows]
    expected = F.cross_entropy(logits, sample.classes)
    torch.testing.assert_close(module.loss(module(sample.features, sample.surface), sample), expected)


def test_the_loss_of_drawn_rows_is_that_of_all_rows_on_average(datamodule):
    sample = next(iter(datamodule.val_dataloader()))
    module, full = make(datamodule, loss_rows=20), make(datamodule)
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
    datamodule = toy_datamodule(tmp_path, descriptor=Coordinates())
    datamodule.prepare_data()
    module, sample = make(datamodule, rotate=True), next(iter(datamodule.val_dataloader()))
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


def test_what_does_not_turn_with_the_shape_is_not_turned(datamodule):
    with pytest.raises(ConfigError, match="descriptor=xyz"):
        make(datamodule, rotate=True)


def test_a_checkpoint_is_plain_data_and_loads_without_a_config(trained, datamodule):
    module, _, path = trained
    content = torch.load(path, weights_only=True)
    assert content["hyper_parameters"]["descriptor"]["name"] == "acd"
    again = load_module(path)
    sample = next(iter(datamodule.val_dataloader()))
    torch.testing.assert_close(again.describe(sample), module.describe(sample))


def test_what_is_no_checkpoint_is_named(tmp_path):
    with pytest.raises(DataError, match="no such checkpoint"):
        load_module(tmp_path / "a.ckpt")
    (tmp_path / "a.ckpt").write_bytes(b"something")
    with pytest.raises(DataError, match=r"a\.ckpt: not a checkpoint"):
        load_module(tmp_path / "a.ckpt")
    torch.save({"state_dict": {}}, tmp_path / "a.ckpt")
    with pytest.raises(DataError, match=r"a\.ckpt: not a checkpoint"):
        load_module(tmp_path / "a.ckpt")


@pytest.mark.parametrize(
    ("schedule", "last"), [("cosine", 0.0), ("step", 0.125e-2), ("drop", 1e-3), ("one_cycle", 4e-8), ("constant", 1e-2)]
)
def test_schedules_end_where_they_should(datamodule, tmp_path, schedule, last):
    trainer = train(make(datamodule, schedule=schedule), datamodule, tmp_path, 3, limit_val_batches=0)
    assert trainer.optimizers[0].param_groups[0]["lr"] == pytest.approx(last, rel=0.3, abs=1e-5)


def test_unknown_names_are_errors_of_the_user(datamodule):
    with pytest.raises(ConfigError, match=r"known are .*csmcnn"):
        make(datamodule, network={"name": "transformer"})
    with pytest.raises(ConfigError, match="format 99"):
        make(datamodule, format=99)
    with pytest.raises(ConfigError, match="loss_rows=0"):
        make(datamodule, loss_rows=0)


def test_the_same_seed_gives_the_same_network(datamodule, tmp_path):
    weights = []
    for run in range(2):
        module = make(datamodule)
        train(module, datamodule, tmp_path / str(run), 2, limit_val_batches=0)
        weights.append(module.network.embed.weight.detach().clone())
    torch.testing.assert_close(*weights)
