"""``csm doctor``: what csm finds on this machine, and what is missing."""

from __future__ import annotations

from csm.commands.main import run_as_program

if __name__ == "__main__":
    run_as_program(__file__)

import importlib.util
import os
import platform
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path
from typing import Any

from omegaconf import DictConfig
from packaging.requirements import Requirement
from threadpoolctl import threadpool_info

from csm._counts import counted
from csm._extras import DISTRIBUTION, install_line
from csm.commands.app import command
from csm.data.registry import find_sets
from csm.data.store import Store
from csm.evaluation.provenance import provenance
from csm.matching.shipped import shipped_models

_IN_WORDS = {
    "viz": "windows with meshes",
    "sweep": "sweeps in parallel or on a cluster",
    "prep": "bodies to train on (csm bodies)",
    "browser": "tests of pages in a browser",
    "peers": "comparison with pyFM and geomfum (csm bench matching)",
    "wandb": "logs for Weights & Biases (logger=wandb)",
    "mlflow": "logs for MLflow (logger=mlflow)",
    "docs": "the site (make docs)",
    "notebooks": "notebooks (docs/notebooks)",
    "dev": "work on csm itself",
}

_NOT_INSTALLED = f"not known: csm runs from a source tree in which {DISTRIBUTION} is not installed (pip install -e .)"


def run(cfg: DictConfig) -> dict[str, Any]:
    """Print what was found; return the numbers of data sets and missing libraries."""
    import numpy  # noqa: F401 - its BLAS is listed once it is loaded

    requirements = installed_requirements()
    missing = missing_of(requirements or [])
    sets = data_sets(cfg.folder)
    rows = [
        ("machine", f"{platform.platform()}, {counted(os.cpu_count() or 1, 'core')}, {memory()}"),
        ("versions", ", ".join(f"{name} {version}" for name, version in provenance().versions.items())),
        ("BLAS", blas()),
        ("devices", devices()),
        ("store", store_in_words(Store(cfg.store))),
        ("networks", ", ".join(shipped_models())),
        (
            "data sets",
            "; ".join(sets) or "none found: set CSM_DATA, or folder=FOLDER (csm check FOLDER looks into one)",
        ),
        *(("extra " + name, text) for name, text in extras(missing).items()),
        *([("extras", _NOT_INSTALLED)] if requirements is None else []),
    ]
    width = max(len(name) for name, _ in rows)
    print("\n".join(f"{name:<{width}}  {text}" for name, text in rows))
    return {"data_sets": len(sets), "missing": sum(len(names) for names in missing.values())}


def installed_requirements() -> list[str] | None:
    """Return the requirements of the installed csm, or None where it runs from a source tree that is not installed."""
    try:
        return metadata.requires(DISTRIBUTION) or []
    except metadata.PackageNotFoundError:
        return None


def missing_of(requirements: list[str]) -> dict[str, list[str]]:
    """Return extra -> what of it is not installed, of requirements as the metadata of a distribution list them.

    Examples
    --------
    >>> missing_of(["numpy>=1", "no-such-thing>=1; extra == 'odd'", "numpy; extra == 'even'"])
    {'odd': ['no-such-thing>=1'], 'even': []}
    """
    found: dict[str, list[str]] = {}
    for text in requirements:
        requirement = Requirement(text)
        extra = next((name for name in _extras_named(text) if requirement.marker is not None), None)
        if extra is None or requirement.marker is None or not requirement.marker.evaluate({"extra": extra}):
            continue
        names = found.setdefault(extra, [])
        try:
            good = requirement.specifier.contains(metadata.version(requirement.name), prereleases=True)
        except metadata.PackageNotFoundError:
            good = False
        if not good:
            names.append(f"{requirement.name}{requirement.specifier}")
    return found


def _extras_named(requirement: str) -> list[str]:
    """Return the extras that the marker of a requirement names."""
    _, _, marker = requirement.partition(";")
    words = marker.replace("'", '"').split('"')
    return [words[k + 1] for k in range(len(words) - 1) if words[k].rstrip().endswith(("extra ==", "extra=="))]


def extras(missing: Mapping[str, list[str]]) -> dict[str, str]:
    """Return extra -> what it is for and whether it is there, in words."""
    return {
        name: f"{_IN_WORDS.get(name, '')}: "
        + (f"not installed ({', '.join(names)}): {install_line(name)}" if names else "installed")
        for name, names in missing.items()
    }


def blas() -> str:
    """Return the libraries of linear algebra with their threads."""
    pools = [pool for pool in threadpool_info() if pool["user_api"] == "blas"]
    return ", ".join(f"{p['internal_api']} {p['version']}, {counted(p['num_threads'], 'thread')}" for p in pools)


def devices() -> str:
    """Return the devices that networks can run on."""
    if importlib.util.find_spec("torch") is None:
        return "PyTorch is not installed"
    import torch

    cards = [f"cuda:{k} ({torch.cuda.get_device_name(k)})" for k in range(torch.cuda.device_count())]
    return ", ".join(["cpu", *cards, *(["mps"] if torch.backends.mps.is_available() else [])])


def memory() -> str:
    """Return the size of the memory, where the system says it."""
    try:
        size = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        return "memory unknown"
    return f"{size / 2**30:.0f} GiB of memory"


def store_in_words(store: Store) -> str:
    """Return where the store is, how much is in it, and whether it can be written."""
    sizes = [path.stat().st_size for path in store.files()]
    fault = store.why_not_writable()
    return f"{store.root}: {counted(len(sizes), 'entry')}, {sum(sizes) / 2**20:.0f} MiB" + (
        f"; {fault}" if fault else ""
    )


def data_sets(folder: str | None) -> list[str]:
    """Return the published sets that are found, with their places."""
    place = Path(folder or os.environ.get("CSM_DATA") or "data")
    return [f"{found.name} ({found.root})" for found in find_sets(place)] if place.is_dir() else []


main = command("doctor")(run)
