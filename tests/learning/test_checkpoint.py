from __future__ import annotations

import json
from pathlib import Path

import lightning as L
import pytest
import torch
from safetensors.torch import load_file

from csm.errors import ConfigError, DataError
from csm.learning.checkpoint import export_module, load_module
from csm.learning.module import CSMModule
from csm.networks import Basis, Surface
from tests.learning.toys import NETWORK


@pytest.fixture
def module() -> CSMModule:
    torch.manual_seed(0)
    return CSMModule(NETWORK, 7, 50, {"name": "hks", "k": 30, "n_times": 7, "scaled": True}, basis_k=24)


def sample() -> tuple[torch.Tensor, Surface]:
    g = torch.Generator().manual_seed(1)
    evecs, _ = torch.linalg.qr(torch.randn(40, 24, generator=g))
    return torch.randn(40, 7, generator=g), Surface(Basis(torch.arange(24.0), evecs, torch.ones(40)))


@pytest.mark.parametrize("classifier", [False, True])
def test_an_export_gives_the_same_descriptor(module, tmp_path, classifier):
    path = export_module(module, tmp_path / "out", classifier=classifier)
    for file in (path, path.with_name("model.safetensors")):
        again = load_module(file)
        torch.testing.assert_close(again.eval()(*sample()), module.eval()(*sample()), atol=0, rtol=0)
    assert torch.equal(again.network.classifier.weight, module.network.classifier.weight) == classifier


def test_an_export_of_another_name_keeps_its_own_weights(module, tmp_path):
    path = export_module(module, tmp_path)
    for file in (path, path.with_name("model.safetensors")):
        file.rename(tmp_path / f"best{file.suffix}")
    with torch.no_grad():
        for weights in (other := load_module(tmp_path / "best.json")).weights().values():
            weights.zero_()
    export_module(other, tmp_path)
    assert any(tensor.any() for tensor in load_module(tmp_path / "best.safetensors").weights().values())


def test_a_folder_is_answered_with_the_checkpoint_in_it(module, tmp_path):
    with pytest.raises(DataError, match=r"a folder, not a checkpoint, and no model.ckpt or model.json is in it"):
        load_module(tmp_path)
    path = export_module(module, tmp_path / "export")
    for folder in (tmp_path, tmp_path / "export"):
        with pytest.raises(DataError, match=f"a folder, not a checkpoint; wanted {path}"):
            load_module(folder)


def test_an_export_is_json_and_safetensors_only(module, tmp_path):
    path = export_module(module, tmp_path)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["model.json", "model.safetensors"]
    assert json.loads(path.read_text())["descriptor"]["name"] == "hks"


def test_faults_of_an_export_are_named(module, tmp_path):
    path = export_module(module, tmp_path)
    weights = tmp_path / "model.safetensors"
    settings = json.loads(path.read_text())
    path.write_text(json.dumps(settings | {"network": NETWORK | {"channels": [16, 16]}}))
    with pytest.raises(DataError, match="another network"):
        load_module(path)
    path.write_text(json.dumps(settings))
    weights.write_bytes(b"cut")
    with pytest.raises(DataError, match=r"model\.safetensors: cannot be read"):
        load_module(path)
    weights.unlink()
    with pytest.raises(DataError, match=r"model\.safetensors: cannot be read"):
        load_module(path)
    path.write_text("[1]")
    with pytest.raises(DataError, match=r"model\.json: not a checkpoint"):
        load_module(path)


@pytest.fixture
def checkpoint(module, tmp_path) -> Path:
    trainer = L.Trainer(logger=False, enable_checkpointing=False, enable_progress_bar=False, max_epochs=0)
    trainer.strategy.connect(module)
    trainer.save_checkpoint(tmp_path / "model.ckpt")
    return tmp_path / "model.ckpt"


def test_a_checkpoint_is_plain_data_and_loads_without_a_config(module, checkpoint):
    content = torch.load(checkpoint, weights_only=True)
    assert content["hyper_parameters"]["descriptor"]["name"] == "hks"
    again = load_module(checkpoint)
    torch.testing.assert_close(again.eval()(*sample()), module.eval()(*sample()), atol=0, rtol=0)
    assert again.has_classifier


def test_a_checkpoint_of_another_format_is_refused(checkpoint):
    content = torch.load(checkpoint, weights_only=True)
    content["hyper_parameters"]["format"] = 99
    torch.save(content, checkpoint)
    with pytest.raises(ConfigError, match="has format 99, this version of csm reads format 1"):
        load_module(checkpoint)


def test_what_is_no_checkpoint_is_named(tmp_path):
    with pytest.raises(DataError, match="no such checkpoint"):
        load_module(tmp_path / "a.ckpt")
    (tmp_path / "a.ckpt").write_bytes(b"something")
    with pytest.raises(DataError, match=r"a\.ckpt: not a checkpoint"):
        load_module(tmp_path / "a.ckpt")
    torch.save({"state_dict": {}}, tmp_path / "a.ckpt")
    with pytest.raises(DataError, match=r"a\.ckpt: not a checkpoint"):
        load_module(tmp_path / "a.ckpt")


def test_an_export_keeps_the_standardisation_and_leaves_the_other_classifiers_out(tmp_path):
    torch.manual_seed(0)
    hks = {"name": "hks", "k": 30, "n_times": 7, "scaled": True}
    module = CSMModule(NETWORK, 7, 50, hks, basis_k=24, standardise=True, also_classes={"others": 60})
    module.inputs.learn([3 + 5 * sample()[0]])
    again = load_module(export_module(module, tmp_path))
    torch.testing.assert_close(again.eval()(*sample()), module.eval()(*sample()), atol=0, rtol=0)
    assert not any(name.startswith("others") for name in load_file(tmp_path / "model.safetensors"))
