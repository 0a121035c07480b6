"""The learned methods that are compared: each a network with its options and the descriptor that it is fed with."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Contender:
    """One learned method.

    Parameters
    ----------
    title
        What tables call it.
    network, options
        For `csm.networks.build`; what is not said keeps the default.
    descriptor
        Preset of its input.
    basis_k
        Eigenpairs that it needs.
    paper_millions
        Parameters in the paper's Table 6, in millions; None where it has none.
    """

    title: str
    network: str
    descriptor: str
    options: Mapping[str, Any] = field(default_factory=dict)
    basis_k: int = 128
    paper_millions: float | None = None


CONTENDERS: Mapping[str, Contender] = {
    "csmcnn": Contender("CSMCNN", "csmcnn", "acd_release", {"momentum": 1e-3, "eps": 1e-3}, paper_millions=1.90),
    "add": Contender("ADD", "mlp", "add", {"widths": (256, 256, 256, 256)}),
    "mgcn": Contender("MGCN", "mgcn", "weds", basis_k=301, paper_millions=3.03),
    "acscnn": Contender("ACSCNN", "acscnn", "acd_release", paper_millions=4.80),
    "splinecnn": Contender("SplineCNN", "splinecnn", "constant", paper_millions=4.11),
    "chebynet": Contender("ChebyNet", "chebynet", "constant"),
    "mlp": Contender("ACD + MLP", "mlp", "acd_paper"),
    "diffusionnet": Contender("DiffusionNet", "diffusionnet", "hks_diffusionnet"),
}
"""The methods of Tables 4 to 6, and today's reference, by the names of the rows of experiments."""

_ROWS = {
    "paper": "CSMCNN",
    "release": "CSMCNN as released",
    "acd": "ACD alone",
    "acd_mgcn": "ACD + MGCN",
    "diffusionnet": "ACD + DiffusionNet",
}


def row_title(row: str) -> str:
    """Return what tables and figures call a row of the experiments on learned methods.

    Parameters
    ----------
    row
        Such as "faust_mgcn" or "scape_paper"; behind a comma may stand the kind of matching.

    Examples
    --------
    >>> row_title("faust_mgcn, argmax"), row_title("scape_paper"), row_title("add"), row_title("ks_64")
    ('MGCN, argmax', 'CSMCNN', 'ADD', 'ks_64')
    """
    name, comma, matching = row.partition(",")
    method = name.partition("_")[2] or name
    title = _ROWS.get(method) or (CONTENDERS[method].title if method in CONTENDERS else name)
    return title + comma + matching
