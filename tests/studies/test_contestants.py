from __future__ import annotations

from pathlib import Path

import lightning as L
import pytest
import torch

from csm.data.store import Store
from csm.descriptors import preset
from csm.descriptors.base import record
from csm.errors import ConfigError, DataError
from csm.learning.export import export_module
from csm.learning.module import CSMModule
from csm.studies.contestants import contestants, trained_on
from tests.shapes import blob
from tests.studies.toys import toy_bodies, toy_context


def module_for(name: str) -> CSMModule:
    torch.manual_seed(0)
    network = {"name": "csmcnn", "ks": 16, "channels": [8, 8], "terms": 2}
    return CSMModule(network, 7, 162, record(preset("acd_isotropic")), basis_k=16, training={"set": name})


def save(module: CSMModule, path: Path) -> None:
    trainer = L.Trainer(logger=False, enable_checkpointing=False, enable_progress_bar=False, max_epochs=0)
    trainer.strategy.connect(module)
    trainer.save_checkpoint(path)


def test_a_trained_network_is_a_method_like_any_other(tmp_path):
    context, bodies = toy_context(tmp_path), toy_bodies()
    module = module_for("toys_162")
    path = export_module(module, tmp_path / "export", classifier=True)
    (method,) = contestants([], {"net": str(path)}, context, bodies).values()
    assert method.describe(blob(2)).shape == (162, 256)
    module.network.lift.bias.data += 1
    changed = export_module(module, tmp_path / "other", classifier=True)
    assert contestants([], {"net": str(changed)}, context, bodies)["net"].key != method.key


def test_networks_of_the_learned_tables_are_found_if_they_know_the_bodies(tmp_path):
    rows = {"toys_mgcn": "toys_162", "toys_paper": "toys_162", "scape_mgcn": "SCAPE_5000", "ks_64": "toys_162"}
    for row, name in rows.items():
        save(module_for(name), tmp_path / "out" / "cells" / row / "seed0" / "model.ckpt")
    save(module_for("toys_162"), tmp_path / "out" / "cells" / "toys_paper" / "seed1" / "model.ckpt")
    assert list(trained_on("toys_162", tmp_path / "out")) == ["MGCN", "CSMCNN"]
    found = contestants(["acd_isotropic"], None, toy_context(tmp_path), toy_bodies())
    assert list(found) == ["ACD isotropic", "MGCN", "CSMCNN"]


def test_nothing_to_compare_is_an_error(tmp_path):
    with pytest.raises(ConfigError, match="checkpoint"):
        contestants([], None, toy_context(tmp_path), toy_bodies())
    with pytest.raises(DataError, match="no such checkpoint"):
        contestants([], {"x": str(tmp_path / "x.ckpt")}, toy_context(tmp_path), toy_bodies())
    assert not Store(tmp_path / "store").root.exists()
