"""``csm sweep-report FOLDER``: one page about a sweep."""

from __future__ import annotations

from csm.commands.main import run_as_program

if __name__ == "__main__":
    run_as_program(__file__)

from pathlib import Path
from typing import Any

from omegaconf import DictConfig

from csm.commands.app import command
from csm.commands.outputs import require_file_place
from csm.errors import ConfigError, DataError
from csm.experiments.sweep_page import is_report, write_sweep_report

_PAGE = "sweep.html"


def run(cfg: DictConfig) -> dict[str, Any]:
    """Write the page; return the number of the best job."""
    if cfg.folder is None:
        raise ConfigError("sweep-report needs the folder of a sweep: csm sweep-report outputs/train_sweep/DATE")
    folder = Path(cfg.folder)
    if not folder.is_dir():
        what = "this is a file, wanted the folder of a sweep" if folder.exists() else "there is no such folder"
        raise DataError(f"{folder}: {what}")
    out = Path(cfg.out) if cfg.out else folder / _PAGE
    require_file_place(out)
    if out.exists() and not cfg.overwrite and not is_report(out):
        raise ConfigError(f"{out}: is there already, and is no page of this command; overwrite=true replaces it")
    best = write_sweep_report(folder, out, cfg.by)
    settings = " ".join(f"{key}={value}" for key, value in best.settings.items())
    print(f"the best is job {best.name}: {settings}\n{out}")
    return {"best": best.name}


main = command("sweep-report")(run)
