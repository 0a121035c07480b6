"""The studies by name; a module is imported when its study is asked for."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module

from csm.errors import ConfigError
from csm.studies.study import Findings


@dataclass(frozen=True)
class Study:
    """A table or figure: what it shows, and the module whose ``run(context, **options)`` makes it."""

    purpose: str
    module: str

    def load(self) -> Callable[..., Findings]:
        """Import the module and return its `run`."""
        run: Callable[..., Findings] = import_module(self.module).run
        return run


STUDIES: Mapping[str, Study] = {
    "table1": Study("errors of nearest-neighbour matching, all descriptors", "csm.studies.table1"),
    "table2": Study("seconds over resolutions, all descriptors", "csm.studies.table2"),
    "table6": Study("parameters, seconds and memory, all learned methods", "csm.studies.table6"),
    "figure2": Study("eigenvalues of one body across resolutions", "csm.studies.figure2"),
    "figure3": Study("errors over the parameters of ACD", "csm.studies.figure3"),
    "figure4": Study("share of points within an error, all descriptors", "csm.studies.figure4"),
    "figure5": Study("pictures of descriptor distances on one body", "csm.studies.figure5"),
    "figure6": Study("pictures of descriptor distances across bodies", "csm.studies.figure6"),
    "figure10": Study("pictures of errors on one body, all methods, across resolutions", "csm.studies.figure10"),
    "figure12": Study("errors over noise of the vertices", "csm.studies.figure12"),
    "figure13": Study("errors with parts cut away or grown together", "csm.studies.figure13"),
    "assumptions": Study("errors when what the sources leave open is chosen otherwise", "csm.studies.assumptions"),
    "stability": Study("change of all descriptors across resolutions of one body", "csm.studies.stability"),
}
"""Every study; a new one is one line here and, if it has options, a section of conf/reproduce.yaml."""


def study(name: str) -> Study:
    """Return the study of a name.

    Raises
    ------
    ConfigError
        If there is none.

    Examples
    --------
    >>> study("table1").module
    'csm.studies.table1'
    """
    if name not in STUDIES:
        raise ConfigError(f"there is no study {name!r}; there are {', '.join(STUDIES)}")
    return STUDIES[name]


def listing() -> str:
    """Return one line per study for ``--help``."""
    return "\n".join(f"  {name:<12}{entry.purpose}" for name, entry in STUDIES.items())
