"""Two processes that train together do what one does with two shapes per step; `two_ranks.py` is what they run."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import lightning as L
import numpy as np
import pytest
import torch
from torch import nn

from csm.errors import ConfigError
from csm.experiments.ranks import Ranks, SharedStatistics, require_one_or_ranks, require_same_begin
from csm.experiments.training import fit, make_trainer
from csm.learning.loading import Share
from tests.experiments import two_ranks
from tests.experiments.toys import a_training
from tests.learning.toys import QUICK


@pytest.fixture(scope="module")
def together(tmp_path_factory) -> SimpleNamespace:
    folder = tmp_path_factory.mktemp("ranks")
    ran = two_ranks.run(folder)
    assert ran.returncode == 0, ran.stderr
    ranks = [json.loads((folder / f"rank{rank}.json").read_text()) for rank in (0, 1)]
    return SimpleNamespace(folder=folder, said=ran.stdout, ranks=ranks)


def close(epochs, wanted) -> None:
    assert [set(epoch) for epoch in epochs] == [set(epoch) for epoch in wanted]
    for one, other in zip(epochs, wanted, strict=True):
        np.testing.assert_allclose([one[key] for key in other], list(other.values()), rtol=2e-4)


@pytest.mark.slow
def test_the_curve_is_that_of_one_process_with_two_shapes_per_step(together, tmp_path):
    """Losses, validation (with statistics of batch normalisation) and rates; both ranks know the same numbers."""
    _, losses = two_ranks.curve(tmp_path, "one", 1)
    assert {"train/loss", "fit/loss", "fit/age", "fit/exact"} <= set(losses.epochs[-1])
    for rank in together.ranks:
        close(rank["epochs"], losses.epochs)
        assert rank["rates"] == losses.rates
    assert len(losses.rates) == 4 * 2
    assert losses.epochs[-1]["train/loss"] < 0.95 * losses.epochs[0]["train/loss"]


@pytest.mark.slow
def test_the_ranks_share_the_order_of_one_process(together, tmp_path):
    _, losses = two_ranks.curve(tmp_path, "one", 1)
    first, second = (rank["shapes"] for rank in together.ranks)
    assert [name for pair in zip(first, second, strict=True) for name in pair] == losses.shapes


@pytest.mark.slow
def test_shapes_that_do_not_divide_evenly_are_validated_once(together, tmp_path):
    wanted = two_ranks.unmoved(tmp_path, 1)
    for rank in together.ranks:
        assert rank["unmoved"].keys() == wanted.keys()
        for name in ("val/loss", "val/age", "val/exact"):
            assert rank["unmoved"][name] == pytest.approx(wanted[name], rel=1e-4)


@pytest.mark.slow
def test_a_step_may_use_some_of_several_classifiers(together, tmp_path):
    _, losses = two_ranks.others(tmp_path, 1)
    close(together.ranks[0]["others"], losses.epochs)


@pytest.mark.slow
def test_rank_zero_alone_prints_and_exports(together):
    lines = [line.partition(":")[0] for line in together.said.splitlines() if line.startswith("epoch")]
    of_two, of_four = (["epoch 1 of 2", "epoch 2 of 2"], [f"epoch {i} of 4" for i in (1, 2, 3, 4)])
    assert lines == [*of_four, *of_two, *of_two]
    names = {path.name for path in (together.folder / "two").iterdir()}
    assert names == {"model.ckpt", "export", "checkpoints", ".csm.lock"}


@pytest.mark.slow
def test_a_training_that_was_stopped_goes_on_with_the_random_states_of_every_rank(together):
    kept, wanted = (
        torch.load(together.folder / name / "model.ckpt", weights_only=True)["state_dict"] for name in ("cut", "whole")
    )
    assert all(torch.equal(kept[name], wanted[name]) for name in wanted)


@pytest.mark.slow
def test_a_checkpoint_of_two_ranks_goes_on_in_one_with_as_many_shapes_per_step(together, caplog, tmp_path):
    (tmp_path / "checkpoints").mkdir()
    last = Path("checkpoints/last.ckpt")
    (tmp_path / last).write_bytes((together.folder / "cut" / last).read_bytes())
    with pytest.raises(ConfigError, match=r"training\.shapes_per_step: 2 there, 1 wanted"):
        fit(a_training(together.folder, 5, **two_ranks.RANDOM), tmp_path)
    going_on = fit(two_ranks.training(together.folder, 5, 1, **two_ranks.RANDOM), tmp_path)
    assert "going on with 1 processes after 2" in caplog.text
    assert torch.load(going_on.checkpoint, weights_only=True)["global_step"] == 5 * 2


def test_shares_are_of_one_size_and_leave_nothing_out():
    for n in (1, 2, 5, 8):
        for ranks in (1, 2, 3, 10):
            shares = [Share(rank, ranks).of(range(n)) for rank in range(ranks)]
            assert {len(share) for share in shares} == {-(-n // ranks)}
            in_order = [share[i] for i in range(len(shares[0])) for share in shares]
            assert in_order[:n] == list(range(n))


def test_other_strategies_of_several_devices_are_refused(tmp_path):
    for how in ({}, {"strategy": "ddp"}):
        trainer = partial(L.Trainer, **(QUICK | {"devices": 2} | how))
        with pytest.raises(ConfigError, match="several devices train together with trainer=ddp"):
            make_trainer(a_training(tmp_path, trainer=trainer), tmp_path)
    trainer = make_trainer(two_ranks.training(tmp_path, 1, 2), tmp_path)
    assert isinstance(trainer.strategy, Ranks)
    require_one_or_ranks(trainer)


def test_ranks_that_do_not_work_in_one_folder_are_refused(tmp_path):
    first = f"in {tmp_path}, from last.ckpt"
    strategy = SimpleNamespace(broadcast=lambda mine: first, cluster_environment=None)
    trainer = SimpleNamespace(strategy=strategy, world_size=2, global_rank=1)
    require_same_begin(trainer, tmp_path, tmp_path / "last.ckpt")
    for folder, begin in ((tmp_path, None), (tmp_path / "other", tmp_path / "last.ckpt")):
        with pytest.raises(ConfigError, match=r"rank 1 would train in .*, and rank 0 in .*last\.ckpt"):
            require_same_begin(trainer, folder, begin)


def test_running_statistics_go_on_from_rank_to_rank():
    torch.manual_seed(0)
    shapes = [torch.randn(20, 3) + k for k in range(3)]
    alone, *ranks = (nn.BatchNorm1d(3, momentum=0.3) for _ in range(4))
    callbacks = [SharedStatistics() for _ in ranks]
    every: list[torch.Tensor] = []
    trainer = SimpleNamespace(world_size=3, strategy=SimpleNamespace(all_gather=lambda mine: torch.stack(every)))
    for callback, rank in zip(callbacks, ranks, strict=True):
        callback.on_train_batch_start(trainer, rank)
    for shape, rank in zip(shapes, ranks, strict=True):
        alone(shape)
        rank(shape)
        every.append(torch.cat([rank.running_mean, rank.running_var]))
    for callback, rank in zip(callbacks, ranks, strict=True):
        callback.on_train_batch_end(trainer, rank)
        torch.testing.assert_close(rank.running_mean, alone.running_mean)
        torch.testing.assert_close(rank.running_var, alone.running_var)
