"""A trained network is a method like any other, from memory, from a checkpoint and from an export."""

from __future__ import annotations

from pathlib import Path

import lightning as L
import numpy as np
import pytest
import torch

from csm.data.store import Store
from csm.descriptors import HKS
from csm.descriptors.base import record
from csm.errors import ConfigError, DataError
from csm.learning.checkpoint import export_module
from csm.learning.module import CSMModule
from csm.matching import match_meshes
from csm.matching.network import NetworkMethod, load_model
from tests.shapes import blob

TRAINING = {"name": "mine", "set": "toys", "seed": 3}


def module_for(k: int = 20, network: str = "csmcnn", training: dict | None = TRAINING) -> CSMModule:
    torch.manual_seed(0)
    options = {"ks": 16, "channels": [8, 8], "terms": 2} if network == "csmcnn" else {}
    return CSMModule({"name": network, **options}, 5, 162, record(HKS(k=k, n_times=5)), basis_k=16, training=training)


def save(module: CSMModule, path: Path) -> Path:
    trainer = L.Trainer(logger=False, enable_checkpointing=False, enable_progress_bar=False, max_epochs=0)
    trainer.strategy.connect(module)
    trainer.save_checkpoint(path)
    return path


@pytest.mark.parametrize("kept", ["memory", "checkpoint", "export", "export with classifier"])
def test_a_network_describes_a_mesh_in_the_same_way_wherever_it_comes_from(tmp_path, kept):
    module, store = module_for(), Store(tmp_path / "store")
    method = {
        "memory": lambda: NetworkMethod(module),
        "checkpoint": lambda: load_model(save(module, tmp_path / "model.ckpt")),
        "checkpoint by text": lambda: load_model(str(save(module, tmp_path / "text.ckpt"))),
        "export": lambda: load_model(export_module(module, tmp_path / "export")),
        "export with classifier": lambda: load_model(export_module(module, tmp_path / "all", classifier=True)),
    }[kept]()
    described, wanted = method.describe(blob(2), store), NetworkMethod(module).describe(blob(2), store)
    torch.testing.assert_close(described.features, wanted.features, rtol=0, atol=0)
    assert described.features.shape == (162, 256)
    assert not described.features.requires_grad
    assert (described.classifier is None) == (kept == "export")
    assert (method.name, method.training["set"]) == ("mine", "toys")
    assert repr(method) == "NetworkMethod('mine', csmcnn)"
    if kept == "export":
        with pytest.raises(ConfigError, match=r"use the \.ckpt file"):
            _ = described.votes
    else:
        assert described.votes.classes.shape == (162,)
        assert method.key == NetworkMethod(module).key


def test_the_key_changes_with_the_weights_and_with_the_input():
    key = NetworkMethod(module_for()).key
    assert NetworkMethod(module_for(), "another name").key == key
    assert NetworkMethod(module_for(k=19)).key != key
    changed = module_for()
    with torch.no_grad():
        changed.network.classifier.bias[0] += 1e-3
    assert NetworkMethod(changed).key != key
    assert NetworkMethod(module_for(network="mlp")).key != key


def test_a_method_has_the_name_that_is_given_or_that_of_its_training():
    assert NetworkMethod(module_for(), "other").name == "other"
    assert NetworkMethod(module_for(training=None)).name == "network"
    assert NetworkMethod(module_for(training=None)).training == {}


def test_what_a_network_needs_is_prepared_and_kept(tmp_path):
    store, method = Store(tmp_path), NetworkMethod(module_for())
    method.describe(blob(2), store)
    assert store.computed == 2
    method.describe(blob(2), store)
    assert store.computed == 2
    assert (method.recipe.basis_k, method.recipe.descriptor) == (16, HKS(k=20, n_times=5))


def test_two_meshes_are_matched_by_a_network_in_both_ways(tmp_path):
    method, store = NetworkMethod(module_for()), Store(tmp_path)
    match = match_meshes(blob(2), blob(2), method, refine="none", store=store)
    np.testing.assert_array_equal(match.indices, np.arange(162))
    through = match_meshes(blob(2), blob(2), method, "argmax", refine="none", store=store)
    described = method.describe(blob(2), store)
    np.testing.assert_array_equal(through.indices, described.votes.vertices[described.votes.classes])


@pytest.mark.gpu
def test_features_and_votes_are_made_on_the_device(tmp_path):
    if not torch.cuda.is_available():
        pytest.skip("needs CUDA")
    method, store = NetworkMethod(module_for()), Store(tmp_path)
    here, there = (method.describe(blob(2), store, device) for device in ("cpu", "cuda"))
    assert there.features.device.type == "cuda"
    torch.testing.assert_close(there.features.cpu(), here.features, rtol=1e-3, atol=1e-3)
    assert (there.votes.classes == here.votes.classes).mean() > 0.95


def test_what_is_no_network_is_named(tmp_path):
    with pytest.raises(DataError, match="no such checkpoint"):
        load_model(tmp_path / "gone.ckpt")


def test_the_key_of_an_export_is_the_same_whenever_it_is_loaded(tmp_path):
    file = export_module(module_for(), tmp_path / "export")
    assert load_model(file).key == load_model(file).key
