from __future__ import annotations

from copy import copy
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch

from csm.data.folder import FolderDataModule
from csm.data.splits import Split
from csm.data.store import Store
from csm.descriptors import HKS
from csm.errors import ConfigError, DataError
from csm.evaluation import EvaluationProtocol, evaluate, targets
from csm.evaluation.report import write_rows
from csm.experiments.testing import measure_all, measure_set, numbers, require_same_test
from csm.learning.loading import LightningData
from csm.matching import as_method
from csm.matching.nearest import Nearest
from csm.matching.network import NetworkMethod
from tests.learning.toys import make
from tests.toyset import write_toys

PROTOCOL = EvaluationProtocol(points=40, distance="edge")
BOTH = ("nearest", "argmax")


@pytest.fixture(scope="module")
def data(tmp_path_factory) -> FolderDataModule:
    folder = tmp_path_factory.mktemp("testing")
    roots = [write_toys(folder / name) for name in ("toys", "again")]
    options = {"descriptor": HKS(k=20, n_times=6), "basis_k": 24, "workers": 0, "store": Store(folder / "store")}
    return FolderDataModule(roots[0], roots, n_test=3, **options)


@pytest.fixture(scope="module")
def network(data) -> NetworkMethod:
    torch.manual_seed(0)
    return NetworkMethod(make(LightningData(data), training={"name": "net", "set": "toys", "seed": 4, "epochs": 7}))


def test_a_set_is_tested_on_the_test_shapes_of_the_split(data, network):
    tested = measure_set(network, data, data.test_sets["again"], PROTOCOL, matching=BOTH, table="mine")
    assert [t.matcher.name for t in tested] == list(BOTH)
    assert [t.label for t in tested] == ["again", "again, argmax"]
    names = data.split.test
    found = evaluate(network, data.train_set, PROTOCOL, matching=BOTH, names=names, store=data.store, workers=0)
    for one, alone in zip(tested, found, strict=True):
        np.testing.assert_array_equal(one.evaluation.errors, alone.errors)
        assert {row.source for row in one.evaluation.rows} == set(names)
        row = one.row
        assert (row.table, row.method, row.train, row.test) == ("mine", "net", "toys", "again")
        assert (row.matching, row.seeds, row.epochs, row.pairs) == (alone.matcher, (4,), 7, 6)
        assert row.age == alone.summary["age"]
        assert row.split == data.split.label
        assert row.weights == (network.weights if row.matching == "nearest" else network.key["weights"])
        assert (one.names, one.shapes.name, one.method) == (names, "again", network)


def test_all_sets_are_tested_one_matcher_after_the_other(data, network):
    tested = measure_all(network, data, PROTOCOL, matching=BOTH)
    assert [t.label for t in tested] == ["toys", "again", "toys, argmax", "again, argmax"]
    assert {t.row.table for t in tested} == {"test"}
    found = numbers(tested)
    assert list(found) == [f"{key}/{t.label}" for t in tested for key in ("age", "exact")]
    assert found["age/toys, argmax"] == tested[2].row.age


def test_a_descriptor_is_trained_on_nothing(data):
    (tested,) = measure_set(as_method(HKS(k=20, n_times=6)), data, data.train_set, PROTOCOL, matching=[Nearest()])
    assert (tested.row.method, tested.row.train, tested.row.seeds, tested.row.epochs) == ("hks", "none", (), None)
    assert tested.row.weights == ""


def test_finished_targets_are_kept(data, network, tmp_path, monkeypatch):
    options = {"matching": BOTH, "results": Store(tmp_path)}
    first = measure_set(network, data, data.train_set, PROTOCOL, **options)
    monkeypatch.setattr(targets, "target_errors", None)
    again = measure_set(network, data, data.train_set, PROTOCOL, **options)
    assert [t.row.age for t in again] == [t.row.age for t in first]


def test_what_cannot_be_tested_is_named(data, network, tmp_path):
    few = FolderDataModule(
        write_toys(tmp_path / "few", 3),
        split=Split("mine", ("toy0",), ("toy1", "toy9")),
        descriptor=HKS(k=20, n_times=6),
        store=data.store,
    )
    with pytest.raises(DataError, match=r"1 of the 2 test shapes of split mine are missing \(toy9\)"):
        measure_set(network, few, few.train_set, PROTOCOL)
    with pytest.raises(ConfigError, match="nearest or argmax"):
        measure_set(network, data, data.train_set, PROTOCOL, matching=["vote"])
    with pytest.raises(ConfigError, match="different names"):
        measure_set(network, data, data.train_set, PROTOCOL, matching=["nearest", "nearest"])


def weighing(weights: str) -> Any:
    return SimpleNamespace(weights=weights, key={"weights": f"{weights}, and the classifier"})


def test_rows_of_another_test_are_not_replaced(data, network, tmp_path):
    require_same_test(tmp_path, data, PROTOCOL, ["nearest"], weighing("any"))
    rows = [replace(t.row, weights="mine") for t in measure_all(network, data, PROTOCOL)]
    write_rows(tmp_path / "rows.json", rows)
    require_same_test(tmp_path, data, PROTOCOL, ["nearest", "argmax"], weighing("mine"))
    require_same_test(tmp_path, data, PROTOCOL, ["nearest"])

    fewer = copy(data)
    fewer.test_sets = {"toys": data.test_sets["toys"]}
    for other, protocol, matching, weights, said in (
        (data, PROTOCOL, ["nearest"], "yours", "network"),
        (data, PROTOCOL, ["argmax"], "mine", "matching"),
        (data, replace(PROTOCOL, points=41), ["nearest"], "mine", "protocol"),
        (data, replace(PROTOCOL, sample=3), ["nearest"], "mine", "protocol"),
        (fewer, PROTOCOL, ["nearest"], "mine", "test set"),
    ):
        with pytest.raises(
            ConfigError, match=rf"rows\.json: has the errors of net on .* with another {said}, .*into a new folder"
        ):
            require_same_test(tmp_path, other, protocol, matching, weighing(weights))
    write_rows(tmp_path / "rows.json", [replace(rows[0], split="other (1 train, 2 test, 0)")])
    with pytest.raises(ConfigError, match="with another split"):
        require_same_test(tmp_path, data, PROTOCOL, ["nearest"])
    write_rows(tmp_path / "rows.json", [replace(rows[0], split="", weights="")])
    require_same_test(tmp_path, data, PROTOCOL, ["nearest"], weighing("mine"))
