"""What the data sets of the field hold, as found in `CSM_DATA`."""

from __future__ import annotations

from typing import NamedTuple

from csm.data import faust, scape, shrec19, tosca
from csm.data.folders import Layout


class Real(NamedTuple):
    """The layout of a set and how many shapes, maps, pairs, missing files and template points it has."""

    layout: Layout
    shapes: int
    mapped: int
    pairs: int
    mapped_pairs: int
    missing: int
    template: int


REAL = {
    "FAUST_6890": Real(faust.RELEASE, 100, 100, 0, 0, 0, 6890),
    "FAUST_10000": Real(faust.LPS, 20, 20, 0, 0, 80, 6890),
    "FAUST_15000": Real(faust.LPS, 20, 20, 0, 0, 80, 6890),
    "FAUST_5k_remeshed": Real(faust.SGA18, 100, 100, 300, 300, 0, 5000),
    "TOSCA_5k_remeshed": Real(tosca.SGA18, 76, 76, 284, 284, 0, 5000),
    "SCAPE_5000": Real(scape.RELEASE, 71, 71, 0, 0, 0, 5000),
    "SHREC19_5k_remeshed": Real(shrec19.REMESHED, 44, 37, 430, 310, 7, 6890),
}
"""By the names of the sets in `CSM_DATA`."""
