"""``csm matrix``: train every row once per seed, test it on every test set, resumable cell by cell."""

from __future__ import annotations

from csm.commands.main import run_as_program

if __name__ == "__main__":
    run_as_program(__file__)

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hydra import compose
from omegaconf import DictConfig, open_dict

from csm.commands.app import command
from csm.commands.groups import make_protocol, matching_of, plain, register
from csm.commands.schema import require_valid
from csm.errors import ConfigError
from csm.evaluation.report import ResultRow, add_rows
from csm.evaluation.tables import LEGEND, markdown_table

if TYPE_CHECKING:  # Lightning is loaded when the options are known to be right
    from csm.experiments.matrix import Row

register("data", "descriptor", "model")

_PLACES = ("root", "test", "test_roots", "test_forms")


def run(cfg: DictConfig) -> dict[str, Any]:
    """Fill the cells that are missing, then print the table over all of them."""
    table = fill(cfg, rows_of(cfg))
    if cfg.results:
        add_rows(cfg.results, table)
    return {f"age/{row.method}/{row.test}{_kind(row)}": row.age for row in table}


def _kind(row: ResultRow) -> str:
    """Say how a row was matched, if not by the nearest neighbour."""
    return "" if row.matching == "nearest" else f", {row.matching}"


def fill(cfg: DictConfig, rows: Sequence[Row]) -> list[ResultRow]:
    """Fill the cells of these rows, print the table and return its averaged rows."""
    from csm.experiments.matrix import Matrix

    matrix = Matrix(
        Path(cfg.folder), make_protocol(cfg), tuple(matching_of(cfg)), str(cfg.table), cfg.train, cfg.device
    )
    table = matrix.fill(rows)
    print(markdown_table(table) + LEGEND)
    return table


def rows_of(cfg: DictConfig) -> list[Row]:
    """Return the rows to fill, one per name and seed.

    Raises
    ------
    ConfigError
        If there are none, or `only` has another name.
    """
    if not cfg.rows:
        raise ConfigError(
            "matrix needs rows, such as '+rows.mine=[\"experiment=humans\"]', or an experiment that has them"
        )
    known = [str(name) for name in cfg.rows]
    names = known if cfg.only is None else [str(name) for name in cfg.only]
    unknown = [name for name in names if name not in known]
    if unknown:
        raise ConfigError(f"matrix has no row {', '.join(unknown)}; it has {', '.join(known)}")
    return [_row(cfg, name, int(seed)) for name in names for seed in cfg.seeds]


def _row(cfg: DictConfig, name: str, seed: int) -> Row:
    from csm.commands.training import make_training, require_network_of_recipe
    from csm.experiments.matrix import Row

    overrides = [*map(str, cfg.rows[name]), *map(str, cfg.overrides)]
    train = compose("train", overrides=overrides)
    require_network_of_recipe(train, overrides)
    with open_dict(train):
        train.update(name=name, seed=seed, store=cfg.store, workers=cfg.workers)
    require_valid(train)
    if train.trainer.devices not in (1, "1") or train.trainer.get("num_nodes", 1) != 1:
        raise ConfigError(
            f"row {name}: trainer.devices={train.trainer.devices}; each row of a matrix is trained on one device, and "
            "several rows at once by several jobs, as in csm matrix -m only=[a],[b] hydra/launcher=ray"
        )
    return Row(name, seed, partial(make_training, train), identity_of(train))


def identity_of(cfg: DictConfig) -> dict[str, Any]:
    """Return the settings that a training depends on, flat; the places of data and the test sets are none of them."""
    settings: Any = plain(cfg)
    found: dict[str, Any] = {"seed": settings["seed"]}
    for group in ("data", "descriptor", "model", "optimizer", "learning"):
        found |= {f"{group}.{key}": value for key, value in settings[group].items() if key not in _PLACES}
    trainer = settings["trainer"]
    found |= {f"trainer.{key}": trainer[key] for key in ("max_epochs", "max_time", "gradient_clip_val", "precision")}
    per_step = trainer["accumulate_grad_batches"]
    return found | {
        "trainer.accumulate_grad_batches": per_step if per_step > 1 else None,
        "pretrained": settings["pretrained"],
    }


main = command("matrix", folder=True)(run)
