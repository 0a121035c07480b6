"""``csm reproduce table1 figure4 ...``: make tables and figures of the paper again from data."""

from __future__ import annotations

from csm.commands.main import run_as_program

if __name__ == "__main__":
    run_as_program(__file__)

import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from hydra import compose
from hydra.core.config_store import ConfigStore
from omegaconf import DictConfig

from csm._parallel import n_processes
from csm.commands import matrix
from csm.commands.app import command
from csm.commands.groups import plain
from csm.data.store import Store
from csm.errors import ConfigError
from csm.evaluation.provenance import provenance
from csm.mesh.io import copy_file
from csm.reproduction.registry import STUDIES, entry, listing, make_study, options_of
from csm.reproduction.study import Context, FilledMatrix, Findings, write_findings

ConfigStore.instance().store(name="studies", node={name: options_of(name) for name in STUDIES}, provider="csm")


def run(cfg: DictConfig) -> dict[str, Any]:
    """Make every study of ``targets``, one after the other."""
    if not cfg.targets:
        raise ConfigError(f"reproduce needs names of studies, such as csm reproduce table1; there are\n{listing()}")
    return make_studies(cfg, [str(name) for name in cfg.targets])


def make_studies(cfg: DictConfig, names: Sequence[str]) -> dict[str, Any]:
    """Run studies by name, print and write their findings, and return the seconds that each took.

    Raises
    ------
    ConfigError
        If a study or one of its options is unknown, before any is begun.
    """
    for name in names:
        entry(name)  # before the options are read, so that the message names the studies
    studies = [make_study(name, plain(cfg[name])) for name in names]
    context = Context(
        root=Path(cfg.data.root),
        out=Path(cfg.out),
        store=Store(cfg.store),
        workers=n_processes(cfg.workers, n_tasks=3),
        seed=int(cfg.seed),
        device=cfg.device,
        fill_matrix=partial(fill_matrix, cfg),
    )
    context.out.mkdir(parents=True, exist_ok=True)
    taken: dict[str, Any] = {}
    for study in studies:
        begun = time.perf_counter()
        findings = study.run(context)
        seconds = time.perf_counter() - begun
        conclude(findings, context.out, cfg.results, seconds)
        taken[f"seconds/{study.name}"] = round(seconds, 1)
    return taken


def fill_matrix(cfg: DictConfig, experiment: str, folder: Path, overrides: Sequence[str]) -> FilledMatrix:
    """Fill the matrix of an experiment in a folder, with the store, workers and device of ``csm reproduce``."""
    fixed = [f"experiment={experiment}", f"folder={folder}", "results=null", f"device={cfg.device}"]
    fixed += [f"store={Store(cfg.store).root}"]
    wanted = compose("matrix", overrides=[*fixed, *overrides])
    rows = matrix.rows_of(wanted)
    settings = {row.name: row.identity for row in rows}
    return FilledMatrix(matrix.fill(wanted, rows), settings)


def conclude(findings: Findings, out: Path, results: str | None, seconds: float) -> None:
    """Write the findings of a study into its folder, copy them into `results` if that is given, and print them."""
    files = [*write_findings(findings, out, provenance(), seconds), *findings.pictures]
    if results:
        for path in files:
            copy_file(path, Path(results) / path.name)
    print(f"\n{findings.markdown()}\n\nin {seconds:.0f} s: {', '.join(str(path) for path in files)}", flush=True)


main = command("reproduce")(run)
