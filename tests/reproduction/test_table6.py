from __future__ import annotations

import sys

import numpy as np
import pytest

from csm.errors import ConfigError
from csm.reproduction import table6
from csm.reproduction.published import NETWORKS
from csm.reproduction.study import Context, Findings
from csm.reproduction.table6 import Table6, cost_of, hparams_of
from tests.reproduction.toys import toy_context
from tests.shapes import blob


@pytest.fixture
def context(tmp_path, monkeypatch) -> Context:
    monkeypatch.setattr(table6, "timed_mesh", lambda *_: (blob(3), "a blob"))
    return toy_context(tmp_path)


def run(context: Context, **options: object) -> Findings:
    return Table6("table6", **options).run(context)  # type: ignore[arg-type]


@pytest.mark.long
def test_rows_have_parameters_seconds_memory_and_ratios_and_are_kept(context, monkeypatch):
    options = {"networks": ("csmcnn", "mlp"), "repeats": 2, "threads": 1}
    findings = run(context, **options)
    first, second = findings.rows
    assert first["parameters"] - first["without classifier"] == (256 + 1) * 642
    assert first["without classifier"] == 1_906_602 - 1_770_730
    assert (first["train to csmcnn"], first["test to csmcnn"]) == (1, 1)
    assert second["train epoch s"] == pytest.approx(80 * np.median(second["measurements"]["train"]))
    assert second["test epoch s"] == pytest.approx(20 * np.median(second["measurements"]["test"]))
    assert findings.pictures[0].is_file()
    assert second["MB"] >= 0, "small networks fit in what the process had at its peak before"
    monkeypatch.setattr(table6, "cost_of", lambda *_: pytest.fail("what is there is not measured again"))
    assert run(context, **options).markdown() == findings.markdown()
    with pytest.raises(pytest.fail.Exception):
        run(context, **options | {"repeats": 3})


@pytest.mark.parametrize(
    "options", [{"networks": ()}, {"networks": ("nope",)}, {"repeats": 0}, {"threads": 0}, {"train_shapes": 0}]
)
def test_wrong_options_are_refused(context, options):
    with pytest.raises(ConfigError, match="table6"):
        run(context, **options)


def cost(train: float, megabytes: float, share: float = 1.0) -> dict[str, np.ndarray]:
    found = {"parameters": 10, "classifier": 4, "train": [train, 9.0, train], "test": [0.5], "share": share}
    return {key: np.asarray(value) for key, value in (found | {"megabytes": megabytes}).items()}


def test_without_the_reference_there_is_no_ratio_and_without_a_count_no_memory(context, monkeypatch):
    monkeypatch.setattr(table6, "cost_of", lambda *_: cost(2.0, np.nan))
    findings = run(context, networks=("mlp",))
    (row,) = findings.rows
    assert (row["method"], row["train to csmcnn"], row["test to csmcnn"]) == (NETWORKS["mlp"].title, None, None)
    assert (row["MB"], row["measurements"]["megabytes"]) == (None, None)
    assert (row["train epoch s"], row["without classifier"]) == (160, 6)
    assert "disturbed" not in " ".join(findings.notes)


def test_a_busy_machine_is_noted_with_the_methods_that_it_disturbed(context, monkeypatch):
    monkeypatch.setattr(table6, "cost_of", lambda hparams, *_: cost(1.0, 3.0, 0.5 + (hparams["basis_k"] > 0)))
    findings = run(context, networks=("csmcnn", "mlp"))
    assert findings.notes[-1] == "Other work disturbed ACD + MLP."


def test_a_cost_is_measured_in_a_process_of_its_own(context):
    hparams = hparams_of("csmcnn") | {"basis_k": 16}
    hparams["network"] |= {"ks": 16, "channels": [8, 8], "terms": 2}
    found = cost_of(hparams, blob(2), context.store, threads=1, repeats=3)
    assert found["train"].shape == found["test"].shape == (3,)
    assert min(*found["train"], *found["test"]) > 0
    assert found["classifier"] == 257 * 162
    assert 0 < found["share"] < 1.5


@pytest.mark.long
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux hands a peak on")
def test_the_memory_of_the_process_that_measures_does_not_hide_that_of_the_network(context):
    hparams = hparams_of("mlp")
    large = np.ones(2**28, dtype=np.uint8)  # a process of its own is told this peak as its own
    found = cost_of(hparams, blob(4), context.store, threads=1, repeats=1)
    assert len(large) == 2**28
    assert found["megabytes"] > 2


def test_a_network_is_given_the_eigenpairs_that_it_wants():
    wanted = {name: hparams_of(name)["basis_k"] for name in ("csmcnn", "diffusionnet", "mlp", "splinecnn")}
    assert wanted == {"csmcnn": 64, "diffusionnet": 128, "mlp": 0, "splinecnn": 0}
