"""What the paper prints in its tables, what it compares, and which of the descriptors had to be guessed at."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from csm.descriptors.presets import preset

SETS: Mapping[str, str] = {"faust": "FAUST", "shrec19": "SHREC'19", "tosca": "TOSCA"}
"""The test sets of Table 1, all remeshed to about 5000 vertices: their names in options, and what the paper calls them.

`csm.data.registry.find_set` calls them FAUST_5k_remeshed, SHREC19_5k_remeshed and TOSCA_5k_remeshed.
"""

AGE: Mapping[str, Mapping[str, int]] = {
    "acd": {"faust": 77, "shrec19": 172, "tosca": 121},
    "asmwd": {"faust": 87, "shrec19": 189, "tosca": 123},
    "wft": {"faust": 124, "shrec19": 228, "tosca": 135},
    "weds": {"faust": 135, "shrec19": 284, "tosca": 154},
    "awft": {"faust": 137, "shrec19": 273, "tosca": 136},
    "wks": {"faust": 145, "shrec19": 215, "tosca": 147},
    "amks": {"faust": 152, "shrec19": 219, "tosca": 152},
    "hks": {"faust": 165, "shrec19": 249, "tosca": 178},
    "dep": {"faust": 167, "shrec19": 254, "tosca": 186},
    "smwd": {"faust": 183, "shrec19": 249, "tosca": 162},
    "shot": {"faust": 199, "shrec19": 315, "tosca": 240},
}
"""Table 1: mean geodesic error in thousandths of the diameter, by family and set."""

RIVALS = ("acd", "acd_paper", "acd_release", *(name for name in AGE if name != "acd"))
"""Presets of the descriptors that the paper compares, in the order of its Table 1; of ACD also csm's own settings."""

SECONDS_AT_6890: Mapping[str, float] = {
    "acd": 5.1,
    "asmwd": 11.7,
    "weds": 20.0,
    "wft": 32.4,
    "awft": 35.2,
    "dep": 62.3,
}
"""Table 2 at 6890 vertices, in seconds on the authors' machine, by family."""

_TESTS = {"faust": ("FAUST_6890", "FAUST_10000", "FAUST_15000"), "scape": ("SCAPE_5000", "SCAPE_12500")}
_TABLES_4_AND_5: Mapping[str, tuple[tuple[int, ...], tuple[int, ...]]] = {
    "add": ((85, 142, 171), (185, 213)),
    "mgcn": ((8, 57, 97), (70, 73)),
    "acscnn": ((3, 225, 265), (27, 370)),
    "splinecnn": ((148, 273, 299), (216, 388)),
    "paper": ((10, 15, 17), (22, 24)),
    "release": ((10, 15, 17), (22, 24)),
}
LEARNED_AGE: Mapping[str, Mapping[str, int]] = {
    f"{train}_{method}": dict(zip(tests, ages[train == "scape"], strict=True))
    for method, ages in _TABLES_4_AND_5.items()
    for train, tests in _TESTS.items()
}
"""Tables 4 and 5 in thousandths of the diameter: row of our experiments -> test set -> error.

CSMCNN has two rows, with the parameters of the text ("faust_paper") and of the release ("faust_release").
"""

ASSUMED: Mapping[str, str] = {
    "asmwd": "k between two published values",
    "wft": "identity of the method, splines, numbering of kernels",
    "awft": "splines",
    "amks": "unit of length of its time",
    "dep": "scales, discount, kind of distance",
    "smwd": "all parameters",
    "shot": "fewest neighbours",
}
"""What of a family is a guess, because no source says it; the docstring of its class says more."""


@dataclass(frozen=True)
class NetworkSetting:
    """One learned method as Table 6 measures it.

    Parameters
    ----------
    title
        What tables call it.
    model
        Out of `csm.networks.MODELS`.
    descriptor
        Preset of its input.
    paper_millions
        Parameters in the paper's Table 6, in millions; None where it has none.
    """

    title: str
    model: str
    descriptor: str
    paper_millions: float | None = None


NETWORKS: Mapping[str, NetworkSetting] = {
    "csmcnn": NetworkSetting("CSMCNN", "csmcnn_release", "acd_release", 1.90),
    "add": NetworkSetting("ADD", "add_mlp", "add"),
    "mgcn": NetworkSetting("MGCN", "mgcn", "weds", 3.03),
    "acscnn": NetworkSetting("ACSCNN", "acscnn", "acd_release", 4.80),
    "splinecnn": NetworkSetting("SplineCNN", "splinecnn", "constant", 4.11),
    "chebynet": NetworkSetting("ChebyNet", "chebynet", "constant"),
    "mlp": NetworkSetting("ACD + MLP", "mlp", "acd_paper"),
    "diffusionnet": NetworkSetting("DiffusionNet", "diffusionnet", "hks_diffusionnet"),
    "osd": NetworkSetting("OSD", "osd", "geometry_vectors"),
    "gcnn": NetworkSetting("GCNN", "gcnn", "geometry_vectors"),
}
"""The methods of Tables 4 to 6, and today's reference, by the names of the rows of experiments."""

_ROWS = {
    "paper": "CSMCNN",
    "release": "CSMCNN as released",
    "acd": "ACD alone",
    "acd_mgcn": "ACD + MGCN",
    "diffusionnet": "ACD + DiffusionNet",
    "acscnn_own_input": "ACSCNN on the input of csm's own network",
    "diffusionnet_own_input": "DiffusionNet on the input of csm's own network",
}


def row_title(row: str) -> str:
    """Return the title, in tables and figures, of a row of the experiments on learned methods, such as "faust_mgcn".

    Examples
    --------
    >>> row_title("faust_mgcn"), row_title("scape_paper"), row_title("add"), row_title("ks_64")
    ('MGCN', 'CSMCNN', 'ADD', 'ks_64')
    """
    method = row.partition("_")[2] or row
    return _ROWS.get(method) or (NETWORKS[method].title if method in NETWORKS else row)


def label(name: str) -> str:
    """Return the name of a preset in figures.

    Examples
    --------
    >>> label("acd_paper"), label("wks")
    ('ACD paper', 'WKS')
    """
    kind, _, rest = name.partition("_")
    return f"{kind.upper()} {rest.replace('_', ' ')}".strip()


def family(name: str) -> str:
    """Return the family of a preset, such as "acd" for "acd_paper"."""
    return preset(name).name
