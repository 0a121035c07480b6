"""A matrix of trainings and tests: every row is trained once per seed and tested on every test set, resumable.

The folder holds, per row and seed, ``model.ckpt``, how it was trained (``row.json``) and per test set and matcher one
json and a page with its worst pairs.  Cells that exist are not computed again, so a matrix that was ended is started
again with the same command; a training goes on from its last epoch, a test from its last target.  Matrices with a
folder in common share the rows that have the same name, and may run at once: each row and seed has a lock, so that
several jobs fill a matrix side by side, every one the rows that it is given (``only=`` and ``seeds=``).
"""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from csm._counts import counted
from csm._locks import locked
from csm._signals import saying
from csm.data.inspection import require_sound
from csm.data.store import Store
from csm.errors import ConfigError, CsmError, DataError
from csm.evaluation.protocol import EvaluationProtocol
from csm.evaluation.report import ResultRow, average_seeds, read_rows, write_curves_csv, write_rows
from csm.experiments._moved import MOVED
from csm.experiments.pairs import write_pairs
from csm.experiments.resuming import last_checkpoint, require_same_settings
from csm.experiments.testing import measure_set
from csm.experiments.training import Training, fit, sketch
from csm.learning.checkpoint import read_checkpoint
from csm.matching.base import require_device
from csm.matching.network import NetworkMethod, load_model
from csm.matching.registry import matchers
from csm.mesh.io import atomic_path, read_bytes

_log = logging.getLogger(__name__)

ROW = "row.json"
"""How the row in a folder is trained."""


@dataclass(frozen=True, eq=False)
class Row:
    """One row and seed of a matrix.

    Parameters
    ----------
    name, seed
        What results call the method, and the seed of its training.
    make
        Makes the training; it is forgotten when the row is filled, as its shapes are many.
    identity
        What the training depends on, flat plain data: a folder that was trained otherwise is refused.
    """

    name: str
    seed: int
    make: Callable[[], Training]
    identity: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Matrix:
    """What the rows of a matrix have in common.

    Parameters
    ----------
    folder
        Where checkpoints and cells are kept.
    protocol
        Of the tests.
    matching
        Names of the matchers.
    table
        Name of the table that the result rows belong to.
    train
        Whether rows without a trained network are trained; otherwise they are left out.
    device
        Where networks run in tests.
    """

    folder: Path
    protocol: EvaluationProtocol
    matching: Sequence[str] = ("nearest",)
    table: str = "matrix"
    train: bool = True
    device: str = "cpu"

    def fill(self, rows: Iterable[Row]) -> list[ResultRow]:
        """Fill the cells that are missing and return the table, averaged over seeds; it is also written as json.

        Raises
        ------
        ConfigError
            Before anything is trained, if a matcher or the device is unknown; after all other rows are done, if some
            failed; or if nothing is trained and nothing may be.
        """
        matchers(self.matching)
        require_device(self.device)
        if not self.train and not self.folder.exists():
            return self._fill(rows)
        self.folder.mkdir(parents=True, exist_ok=True)
        kept = f"finished cells are kept in {self.folder}; the same command goes on with the others"
        with saying(lambda: kept):
            return self._fill(rows)

    def _fill(self, rows: Iterable[Row]) -> list[ResultRow]:
        found: list[ResultRow] = []
        failures: list[str] = []
        for row in rows:
            if not self.train and not self._checkpoint(row).exists():
                _log.warning("%s, seed %s: not trained yet, left out (train=false)", row.name, row.seed)
                continue
            try:
                found += self._fill_row(row)
            except CsmError as error:
                failures.append(f"{row.name}, seed {row.seed}: {error}")
                _log.error("%s", failures[-1])
        table = average_seeds(found)
        if table:
            write_rows(self.folder / f"{self.table}.json", table)
        if failures:
            many = f"{counted(len(failures), 'row')} of the matrix failed, the others are done:\n"
            raise ConfigError(many + "\n".join(failures))
        if not table:
            raise ConfigError(
                f"{self.folder}: no network of these rows and seeds is trained, and train=false trains none"
            )
        return table

    def _place(self, row: Row) -> Path:
        return self.folder / row.name / f"seed{row.seed}"

    def _checkpoint(self, row: Row) -> Path:
        return self._place(row) / "model.ckpt"

    def _fill_row(self, row: Row) -> list[ResultRow]:
        """Return the rows of every test set, one matcher after the other, while no other run works on them."""
        with locked(self._place(row) / ROW, wait=0):
            return self._fill_locked(row)

    def _fill_locked(self, row: Row) -> list[ResultRow]:
        known = require_same_training(self._place(row), row.identity)
        training = row.make()
        _ = training.source  # read now: a wrong path must not be kept as how the row is trained
        if not known:
            self._require_same_network(row, training)
            keep_training(self._place(row), row.identity)
        tests = training.data.test_sets
        found = {(test, rule): cell for test in tests for rule, cell in self._cells(row, training, test).items()}
        return [found[test, rule] for rule in self.matching for test in tests]

    def _require_same_network(self, row: Row, training: Training) -> None:
        """Refuse a network of other settings in a folder that does not tell any more how it was trained."""
        for path in (self._checkpoint(row), last_checkpoint(self._place(row))):
            if path.exists():
                with suppress(DataError):  # a damaged one is made again
                    read_checkpoint(path)
                    require_same_settings(path, sketch(training, None))

    def _cells(self, row: Row, training: Training, test: str) -> dict[str, ResultRow]:
        """Return the rows of one test set, from files that answer the same question or measured together."""
        cells = {rule: self._kept(self._file(row, test, rule)) for rule in self.matching}
        missing = [rule for rule, cell in cells.items() if cell is None]
        if missing:
            tested = measure_set(
                self._method(row, training),
                training.data,
                training.data.test_sets[test],
                self.protocol,
                matching=missing,
                table=self.table,
                results=Store(self._place(row) / "targets"),
                device=self.device,
            )
            for one in tested:
                path = self._file(row, test, one.row.matching)
                write_rows(path, [one.row])
                write_curves_csv(path.with_suffix(".cqc.csv"), {test: one.evaluation})
                write_pairs(path.with_suffix(".html"), one)
                cells[one.row.matching] = one.row
        return {rule: cell for rule, cell in cells.items() if cell is not None}

    def _method(self, row: Row, training: Training) -> NetworkMethod:
        """Return the trained network of a row: the one in the folder, or trained now."""
        place, checkpoint = self._place(row), self._checkpoint(row)
        if checkpoint.exists():
            try:
                return load_model(checkpoint, row.name)
            except DataError as error:
                _log.warning("%s; it is trained again", error)
        exact = self.protocol.distance == "exact" and not self.protocol.fallback
        require_sound(training.data, exact=exact, progress=False)
        return NetworkMethod(fit(training, place).module, row.name)

    def _file(self, row: Row, test: str, rule: str) -> Path:
        kind = "" if rule == "nearest" else f"_{rule}"
        return self._place(row) / f"{test}_{self.protocol.distance}_{self.protocol.normaliser}{kind}.json"

    def _kept(self, path: Path) -> ResultRow | None:
        if not path.exists():
            return None
        try:
            (row,) = read_rows(path)
        except (DataError, ValueError) as error:
            _log.warning("%s: is damaged (%s); it is measured again", path, error)
            return None
        if row.protocol == self.protocol.describe(row.pairs):
            return replace(row, table=self.table)  # a matrix that shares the folder may have measured it
        _log.warning("%s answers another protocol (%s); it is computed again", path, row.protocol)
        return None


def keep_training(folder: Path, identity: Mapping[str, Any]) -> None:
    """Keep in a folder how a row is trained."""
    with atomic_path(folder / ROW) as temporary:
        temporary.write_text(json.dumps(_comparable(identity), indent=1) + "\n", encoding="utf-8")


def require_same_training(folder: Path, identity: Mapping[str, Any]) -> bool:
    """Refuse a folder in which a row was trained otherwise, and return whether the folder tells how.

    An option that is off and that the folder does not know of came with a later version and changes nothing.

    Raises
    ------
    ConfigError
        With the entries that differ.
    """
    path, wanted = folder / ROW, _comparable(identity)
    if not path.exists():
        return False
    try:
        content = json.loads(read_bytes(path))
        if not content:
            raise ValueError("there is nothing in it")
        kept = _comparable(content)
    except (ValueError, TypeError, AttributeError, RecursionError) as error:
        _log.warning("%s: is damaged (%s); it is written again, from the settings that are wanted", path, error)
        return False
    changed = [
        f"{key}: {kept.get(key)} there, {wanted.get(key)} wanted"
        for key in sorted({*kept, *wanted})
        if kept.get(key) != wanted.get(key) and (key in kept or wanted[key])
    ]
    if changed:
        raise ConfigError(
            f"{folder} was trained otherwise ({'; '.join(changed)}); give the row another name, choose another "
            "folder=, or remove that one"
        )
    return True


def _comparable(identity: Mapping[str, Any]) -> dict[str, Any]:
    """Return the settings as json has them, with today's names; where classes and split files lie plays no part."""
    found: dict[str, Any] = {MOVED.get(k, k): value for k, value in json.loads(json.dumps(dict(identity))).items()}
    for key in ("data._target_", "descriptor._target_"):
        if key in found:
            found[key] = found[key].rpartition(".")[2]
    if found.get("data.split"):
        found["data.split"] = Path(found["data.split"]).stem
    return found
