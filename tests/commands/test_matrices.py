"""The matrices of conf/experiment: that they hold the paper's rows and mean the same by the same names."""

from __future__ import annotations

import pytest
from hydra import compose, initialize_config_dir
from omegaconf import OmegaConf

from csm.commands.choices import config_folder
from csm.commands.matrix import rows_of
from csm.errors import ConfigError
from csm.reproduction.learned import varied
from csm.reproduction.published import LEARNED_AGE, row_title
from csm.reproduction.registry import STUDIES
from csm.reproduction.study import FilledMatrix

LEARNED = {name: entry.fixed for name, entry in STUDIES.items() if "experiment" in entry.fixed}


def experiment(name: str, *overrides: str):
    with initialize_config_dir(str(config_folder()), version_base="1.3"):
        return compose("matrix", [f"experiment={name}", *overrides])


def names_of(name: str) -> list[str]:
    """Return the names of the rows that a matrix fills."""
    with initialize_config_dir(str(config_folder()), version_base="1.3"):
        return list(dict.fromkeys(row.name for row in rows_of(compose("matrix", [f"experiment={name}"]))))


@pytest.mark.parametrize("name", ["table4", "table5"])
def test_the_rows_of_the_tables_are_those_of_the_paper(name):
    rows = experiment(name).rows
    published = {method for method in LEARNED_AGE if method.split("_")[0] == next(iter(rows)).split("_")[0]}
    assert published <= set(rows)


def test_studies_that_share_a_folder_mean_the_same_by_a_row_of_one_name():
    by_folder: dict[str, dict[str, list[str]]] = {}
    for study in LEARNED.values():
        known = by_folder.setdefault(study["cells"], {})
        for row, overrides in experiment(study["experiment"]).rows.items():
            assert known.setdefault(str(row), list(overrides)) == list(overrides)


def test_the_figures_compare_what_their_captions_say():
    assert [row_title(row) for row in names_of("figure9")] == ["CSMCNN", "ACD + MGCN", "ACD + DiffusionNet"]
    assert [row_title(row) for row in names_of("figure11")] == ["ACD alone", "ACD + MLP", "CSMCNN"]


def test_an_experiment_does_not_change_the_network_of_a_recipe_in_silence():
    with initialize_config_dir(str(config_folder()), version_base="1.3"):
        rows = '{fine: ["recipe=mlp", "experiment=humans_rival"], bad: ["recipe=mlp", "experiment=humans_paper"]}'
        cfg = compose("matrix", [f"+rows={rows}"])
        assert rows_of(OmegaConf.merge(cfg, {"only": ["fine"]}))[0].identity["model.name"] == "mlp"
        with pytest.raises(ConfigError, match="recipe=mlp trains mlp, but experiment=humans_paper chooses csmcnn"):
            rows_of(OmegaConf.merge(cfg, {"only": ["bad"]}))


@pytest.mark.parametrize("how", ["trainer.devices=2", "trainer=ddp"])
def test_a_row_of_several_devices_is_refused(how):
    with (
        initialize_config_dir(str(config_folder()), version_base="1.3"),
        pytest.raises(ConfigError, match="each row of a matrix is trained on one device, and several rows at once"),
    ):
        rows_of(compose("matrix", [f'+rows={{a: ["experiment=humans_rival", "recipe=mlp", "{how}"]}}']))


def test_how_a_row_takes_steps_is_part_of_what_it_is():
    def identity(*words: str) -> dict[str, object]:
        rows = ", ".join(f'"{word}"' for word in ("experiment=humans_rival", "recipe=mlp", *words))
        return dict(rows_of(compose("matrix", [f"+rows={{a: [{rows}]}}"]))[0].identity)

    with initialize_config_dir(str(config_folder()), version_base="1.3"):
        assert identity() | {"trainer.accumulate_grad_batches": 4} == identity("trainer.accumulate_grad_batches=4")
        assert identity() | {"trainer.precision": "bf16-mixed"} == identity("trainer.precision=bf16-mixed")


def test_an_ablation_varies_one_option_at_a_time():
    with initialize_config_dir(str(config_folder()), version_base="1.3"):
        rows = rows_of(compose("matrix", ["experiment=ablation"]))
    found = varied(FilledMatrix([], {row.name: row.identity for row in rows}))
    assert {label: list(values) for label, values in found.items()} == {
        "eigenpairs $K_s$": [128, 16, 32, 64, 256],
        "terms": [6, 1, 2, 3, 12, 20],
        "BatchNorm momentum": [0.1, 0.001, 0.01, 0.5],
        "normalisation": ["batch", "instance", "none"],
    }
    assert {next(iter(values.values())) for values in found.values()} == {"ks_128_terms_6_momentum_0.1"}
    assert found["terms"][12] == "terms_12"
