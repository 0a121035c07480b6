"""The studies by name; a module is imported when its study is asked for."""

from __future__ import annotations

import inspect
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from csm._places import load
from csm.errors import ConfigError

if TYPE_CHECKING:
    from csm.reproduction.study import Study


@dataclass(frozen=True)
class Entry:
    """What a study shows, where its class is, and the fields of it that are not options."""

    purpose: str
    place: str
    fixed: Mapping[str, Any] = field(default_factory=dict)

    def load(self) -> type[Study]:
        """Import the class."""
        found: type[Study] = load(f"csm.reproduction.{self.place}")
        return found


def _learned(purpose: str, experiment: str, cells: str, picture: str) -> Entry:
    return Entry(purpose, "learned:Learned", {"experiment": experiment, "cells": cells, "picture": picture})


STUDIES: Mapping[str, Entry] = {
    "table1": Entry("errors of nearest-neighbour matching, all descriptors", "table1:Table1"),
    "table2": Entry("seconds over resolutions, all descriptors", "timing:Table2"),
    "table4": _learned("errors of the learned methods on FAUST at three resolutions", "table4", "faust", "dots"),
    "table5": _learned("errors of the learned methods on SCAPE", "table5", "scape", "dots"),
    "table6": Entry("parameters, seconds and memory, all learned methods", "table6:Table6"),
    "figure2": Entry("eigenvalues of one body across resolutions", "resolutions:Figure2"),
    "figure3": Entry("errors over the parameters of ACD", "training_pairs:Figure3"),
    "figure4": Entry("share of points within an error, all descriptors", "table1:Figure4"),
    "figure5": Entry("pictures of descriptor distances on one body", "descriptor_distances:Figure5"),
    "figure6": Entry("pictures of descriptor distances across bodies", "descriptor_distances:Figure6"),
    "figure7": _learned("share of points within an error, the methods of table4", "table4", "faust", "curves"),
    "figure8": _learned("share of points within an error, the methods of table5", "table5", "scape", "curves"),
    "figure9": _learned("ACD fed to MGCN, DiffusionNet and CSMCNN", "figure9", "faust", "curves"),
    "figure10": Entry("pictures of errors on one body, all methods, across resolutions", "methods_on_bodies:Figure10"),
    "figure11": _learned("ACD alone, with a perceptron and with CSMCNN", "figure11", "faust", "curves"),
    "figure12": Entry("errors over noise of the vertices", "methods_on_bodies:Figure12"),
    "figure13": Entry("errors with parts cut away or grown together", "methods_on_bodies:Figure13"),
    "confidence": Entry("confidence of matches against the truth; also fits it", "confidence:ConfidenceStudy"),
    "refinement": Entry("errors before and after refinement", "refinement:Refinement"),
    "coarse": _learned("the methods of table4 on 1000 vertices, hardly cut short", "coarse", "coarse", "dots"),
    "humans_table": _learned("the methods of table4 on the built-in humans", "humans_table", "humans", "dots"),
    "lab": _learned("what each part of csm's own network is worth, on held-out training shapes", "lab", "lab", "dots"),
    "ablation": _learned("K_s, terms and normalisation of CSMCNN", "ablation", "ablation", "sweeps"),
    "assumptions": Entry("errors when what the sources leave open is chosen otherwise", "training_pairs:Assumptions"),
    "stability": Entry("change of all descriptors across resolutions of one body", "resolutions:Stability"),
    "triangulations": Entry(
        "errors of a perfect map and of networks in other triangulations", "triangulations:Triangulations"
    ),
    "benchmark_peers": Entry("errors, seconds and memory of csm, pyFM and geomfum side by side", "peers:Peers"),
}
"""Name of the study -> its purpose and class.  A new study is one class and one line here."""


def entry(name: str) -> Entry:
    """Return the entry of a study; ConfigError if there is none.

    Examples
    --------
    >>> entry("table1").place
    'table1:Table1'
    """
    if name not in STUDIES:
        raise ConfigError(f"there is no study {name!r}; there are {', '.join(STUDIES)}")
    return STUDIES[name]


def options_of(name: str) -> dict[str, Any]:
    """Return the options of a study with their defaults, as plain data."""
    return entry(name).load().options()


def explained(name: str) -> dict[str, str]:
    """Return what the docstring of a study says of each of its options.

    Examples
    --------
    >>> explained("refinement")["sample"]
    'How many pairs of a set are drawn; None for all.'
    """
    found: dict[str, str] = {}
    for cls in reversed(entry(name).load().__mro__):
        text = inspect.cleandoc(cls.__doc__ or "").partition("Parameters\n----------\n")[2]
        for block in re.split(r"\n(?=\w)", text.partition("\n\n")[0]):
            names, _, words = block.partition("\n")
            found |= dict.fromkeys(names.split(", "), " ".join(words.split()))
    return {key: found.get(key, "") for key in options_of(name)}


def make_study(name: str, options: Mapping[str, Any]) -> Study:
    """Make a study, with defaults for options that are not given; ConfigError if a study or option is unknown."""
    found, known = entry(name), options_of(name)
    unknown = [key for key in options if key not in known]
    if unknown:
        raise ConfigError(f"{name} has no option {', '.join(unknown)}; it has {', '.join(known) or 'none'}")
    plain = {key: tuple(value) if isinstance(value, list) else value for key, value in options.items()}
    return found.load()(name=name, **found.fixed, **plain)


def listing() -> str:
    """Return one line per study for ``--help``."""
    return "\n".join(f"  {name:<16}{found.purpose}" for name, found in STUDIES.items())
