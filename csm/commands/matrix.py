"""``csm matrix``: train every row once per seed, test it on every test set, resumable cell by cell.

The folder holds, per row and seed, ``model.ckpt``, how it was trained (``row.json``) and one json per test set.  What
is there is not made again, so a killed matrix is started again with the same command; a training goes on from its last
epoch.  Matrices with a folder in common share the rows that have the same name.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

from hydra import compose
from omegaconf import DictConfig, OmegaConf, open_dict

from csm.commands.app import command, make_datamodule, write_json
from csm.commands.testing import Matching, protocol_of, test_on
from csm.commands.train import fit
from csm.data.datamodule import CorrespondenceDataModule
from csm.errors import ConfigError, CsmError
from csm.evaluation.report import ResultRow, add_rows, average_seeds, read_rows, write_curves_csv, write_rows
from csm.evaluation.tables import markdown_table
from csm.learning.export import load_module
from csm.learning.module import CSMModule

_log = logging.getLogger(__name__)
_PLACES = ("root", "test", "test_roots")


def run(cfg: DictConfig) -> dict[str, Any]:
    """Fill the cells that are missing, then write the table over all of them."""
    if not cfg.rows:
        raise ConfigError(
            "matrix needs rows, such as '+rows.mine=[\"experiment=humans\"]', or an experiment that has them"
        )
    folder = Path(cfg.folder)
    rows: list[ResultRow] = []
    failures: list[str] = []
    for name, overrides in chosen_rows(cfg).items():
        for seed in cfg.seeds:
            place = folder / name / f"seed{seed}"
            if not cfg.train and not (place / "model.ckpt").exists():
                _log.warning("%s, seed %s: not trained yet, left out (train=false)", name, seed)
                continue
            try:
                rows += Cells(cfg, name, overrides, int(seed), place).fill()
            except CsmError as error:
                failures.append(f"{name}, seed {seed}: {error}")
                _log.error("%s", failures[-1])
    table = average_seeds(rows)
    if table:
        write_rows(folder / f"{cfg.table}.json", table)
        print(markdown_table(table))
    if cfg.results and table:
        add_rows(cfg.results, table)
    if failures:
        raise ConfigError(f"{len(failures)} rows of the matrix failed, the others are done:\n" + "\n".join(failures))
    if not table:
        raise ConfigError(f"{folder} has no trained network of these rows and seeds, and train=false makes none")
    return {f"age/{row.method}/{row.test}": row.age for row in table}


def chosen_rows(cfg: DictConfig) -> dict[str, list[str]]:
    """Return the rows to fill, name -> overrides of ``csm train``; ConfigError if `only` has another name."""
    rows = {str(name): [str(text) for text in overrides] for name, overrides in cfg.rows.items()}
    only = list(rows) if cfg.only is None else [str(name) for name in cfg.only]
    unknown = [name for name in only if name not in rows]
    if unknown:
        raise ConfigError(f"matrix has no row {', '.join(unknown)}; it has {', '.join(rows)}")
    return {name: rows[name] for name in only}


class Cells:
    """One row and seed of a matrix: a training and its tests, each made when it is first needed.

    Parameters
    ----------
    cfg
        Of the matrix.
    name, overrides, seed
        The row: what it is called in the table, what it changes in the configuration of ``csm train``, the seed.
    folder
        Where checkpoint and cells are kept.
    """

    def __init__(self, cfg: DictConfig, name: str, overrides: Sequence[str], seed: int, folder: Path) -> None:
        self.name, self.seed, self.folder, self.table = name, seed, folder, str(cfg.table)
        self.protocol = protocol_of(cfg.metric)
        self.matchings: list[Matching] = list(cfg.matching)
        last = folder / "checkpoints" / "last.ckpt"
        self.train_cfg = compose("train", overrides=[*overrides, *cfg.overrides])
        with open_dict(self.train_cfg):
            self.train_cfg.update(
                name=name,
                seed=seed,
                store=cfg.store,
                workers=cfg.workers,
                resume=str(last) if last.exists() else None,
            )

    @cached_property
    def datamodule(self) -> CorrespondenceDataModule:
        """The data module of the row."""
        return make_datamodule(self.train_cfg)

    @cached_property
    def module(self) -> CSMModule:
        """The trained network: the one in the folder, or trained now."""
        checkpoint = self.folder / "model.ckpt"
        if checkpoint.exists():
            return load_module(checkpoint)
        return fit(self.train_cfg, self.datamodule, self.folder)[0]

    def require_same_training(self) -> None:
        """Keep how the row is trained, or refuse what the folder holds if it was trained otherwise.

        An option that is off and that the folder does not know of came with a later version and changes nothing.

        Raises
        ------
        ConfigError
            With the entries that differ.
        """
        path, wanted = self.folder / "row.json", training_of(self.train_cfg)
        if not path.exists():
            write_json(path, wanted)
            return
        kept = json.loads(path.read_text(encoding="utf-8"))
        changed = [
            f"{key}: {kept.get(key)} there, {wanted.get(key)} wanted"
            for key in sorted({*kept, *wanted})
            if kept.get(key) != wanted.get(key) and (key in kept or wanted[key])
        ]
        if changed:
            raise ConfigError(
                f"{self.folder} was trained otherwise ({'; '.join(changed)}); call the row otherwise, choose "
                "another folder=, or remove that one"
            )

    def fill(self) -> list[ResultRow]:
        """Return the rows of every test set, one matching after the other, from files that answer the same question."""
        self.require_same_training()
        rows = {
            (test, matching): row for test in self.datamodule.test_sets for matching, row in self._cells(test).items()
        }
        return [rows[test, matching] for matching in self.matchings for test in self.datamodule.test_sets]

    def _cells(self, test: str) -> dict[Matching, ResultRow]:
        """Return the rows of one test set, whose shapes are described once for all that is missing."""
        rows = {matching: self._kept(self._file(test, matching)) for matching in self.matchings}
        missing = [matching for matching, row in rows.items() if row is None]
        if missing:
            shapes = self.datamodule.test_sets[test]
            for tested in test_on(self.module, self.datamodule, shapes, self.protocol, self.table, missing):
                path = self._file(test, tested.matching)
                write_rows(path, [tested.row])
                write_curves_csv(path.with_suffix(".cqc.csv"), {test: tested.evaluation})
                rows[tested.matching] = tested.row
        return {matching: row for matching, row in rows.items() if row is not None}

    def _file(self, test: str, matching: Matching) -> Path:
        kind = "" if matching == "nearest" else f"_{matching}"
        return self.folder / f"{test}_{self.protocol.distance}_{self.protocol.normaliser}{kind}.json"

    def _kept(self, path: Path) -> ResultRow | None:
        if not path.exists():
            return None
        (row,) = read_rows(path)
        if row.protocol == self.protocol.describe(row.pairs):
            return row
        _log.warning("%s answers another protocol (%s); it is made again", path, row.protocol)
        return None


def training_of(cfg: DictConfig) -> dict[str, Any]:
    """Return what a training depends on, flat: seed, data without their place and test sets, network, optimisation."""
    plain: Any = OmegaConf.to_container(cfg, resolve=True)
    found: dict[str, Any] = {"seed": plain["seed"]}
    for group in ("data", "descriptor", "model", "optimizer"):
        found |= {f"{group}.{key}": value for key, value in plain[group].items() if key not in _PLACES}
    if found.get("data.split"):
        found["data.split"] = Path(found["data.split"]).name
    return found | {f"trainer.{key}": plain["trainer"][key] for key in ("max_epochs", "max_time", "gradient_clip_val")}


main = command("matrix")(run)

if __name__ == "__main__":
    main()
