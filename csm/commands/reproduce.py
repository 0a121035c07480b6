"""``csm reproduce table1 figure4 ...``: make tables and figures of the paper again from data."""

from __future__ import annotations

import inspect
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from omegaconf import DictConfig, OmegaConf

from csm._processes import processes
from csm.commands.app import command
from csm.commands.learned import LEARNED
from csm.commands.learned import make as make_learned
from csm.data.store import Store
from csm.errors import ConfigError
from csm.evaluation.provenance import provenance
from csm.mesh.io import copy_file
from csm.studies.registry import listing, study
from csm.studies.study import Context, Findings, write_findings


def _listing() -> str:
    return "\n".join([listing(), *(f"  {name:<12}{entry.purpose}" for name, entry in LEARNED.items())])


OmegaConf.register_new_resolver("studies", _listing, replace=True)


def run(cfg: DictConfig) -> dict[str, Any]:
    """Make every study of ``targets``, one after the other."""
    if not cfg.targets:
        raise ConfigError(f"reproduce needs names of studies, such as csm reproduce table1; there are\n{_listing()}")
    return make_studies(cfg, [str(name) for name in cfg.targets])


def make_studies(cfg: DictConfig, names: Sequence[str]) -> dict[str, Any]:
    """Make studies by name, print and write what they find, and return how long each took.

    Raises
    ------
    ConfigError
        If a study or one of its options is unknown, before any is begun.
    """
    context = Context(
        Path(cfg.data.root), Path(cfg.out), Store(cfg.store), processes(cfg.workers, n_jobs=3), int(cfg.seed)
    )
    wanted = {name: _maker(cfg, context, name) for name in names}
    context.out.mkdir(parents=True, exist_ok=True)
    taken: dict[str, Any] = {}
    for name, make in wanted.items():
        begun = time.perf_counter()
        findings = make()
        seconds = time.perf_counter() - begun
        conclude(findings, context.out, cfg.results, seconds)
        taken[f"seconds/{name}"] = round(seconds, 1)
    return taken


def _maker(cfg: DictConfig, context: Context, name: str) -> Callable[[], Findings]:
    if name in LEARNED:
        return partial(make_learned, cfg, context, name)
    return partial(study(name).load(), context, **options_of(cfg, name))


def options_of(cfg: DictConfig, name: str) -> dict[str, Any]:
    """Return the options of a study, which are the keys of the section that has its name.

    Raises
    ------
    ConfigError
        If the study has no such option.
    """
    section = OmegaConf.to_container(cfg.get(name) or OmegaConf.create(), resolve=True)
    assert isinstance(section, dict)
    options: Mapping[str, Any] = {str(key): value for key, value in section.items()}
    known = [p.name for p in inspect.signature(study(name).load()).parameters.values() if p.kind is p.KEYWORD_ONLY]
    unknown = [key for key in options if key not in known]
    if unknown:
        raise ConfigError(f"{name} has no option {', '.join(unknown)}; it has {', '.join(known) or 'none'}")
    return dict(options)


def conclude(findings: Findings, out: Path, results: str | None, seconds: float) -> None:
    """Write what a study found into its folder, copy it into `results` if that is given, and print it."""
    files = [*write_findings(findings, out, provenance(), seconds), *findings.pictures]
    if results:
        for path in files:
            copy_file(path, Path(results) / path.name)
    print(f"\n{findings.markdown()}\n\nin {seconds:.0f} s: {', '.join(str(path) for path in files)}", flush=True)


main = command("reproduce")(run)

if __name__ == "__main__":
    main()
