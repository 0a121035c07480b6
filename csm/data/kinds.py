"""The layouts of data sets that csm knows, what they hold as published, and where to get them."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Kind:
    """A published layout of a data set.

    Parameters
    ----------
    key
        Short name for options and tests.
    title
        What people call it.
    origin
        Where it comes from and on what terms; csm never downloads it.
    """

    key: str
    title: str
    origin: str


MPI_FAUST = Kind(
    "mpi_faust",
    "MPI-FAUST",
    "MPI-FAUST.zip from http://faust.is.tue.mpg.de (registration with the Max Planck Institute is needed; "
    "non-commercial research, no redistribution)",
)
ACD_FAUST = Kind(
    "acd_faust",
    "ACD release, FAUST",
    "https://github.com/Wang-Chen9/Anisotropic-Chebyshev-Descriptor, CSMCNN/datasets/FAUST (MPI-FAUST terms)",
)
ACD_SCAPE = Kind(
    "acd_scape",
    "ACD release, SCAPE",
    "https://github.com/Wang-Chen9/Anisotropic-Chebyshev-Descriptor, CSMCNN/datasets/SCAPE (research only)",
)
LPS = Kind(
    "lps", "LPS-data", "https://github.com/yiqun-wang/LPS-data, faust_all_8000 to faust_all_15000 (MPI-FAUST terms)"
)
SGA18_FAUST = Kind(
    "sga18_faust",
    "SGA18/BCICP remeshed FAUST",
    "https://github.com/llorz/SGA18_orientation_BCICP_dataset, Dataset/FAUST (MPI-FAUST terms)",
)
SGA18_TOSCA = Kind(
    "sga18_tosca",
    "SGA18/BCICP remeshed TOSCA",
    "https://github.com/llorz/SGA18_orientation_BCICP_dataset, Dataset/TOSCA_Isometric (academic use)",
)
SHREC19 = Kind(
    "shrec19",
    "SHREC'19 remeshed",
    "https://github.com/llorz/SGA20_mapExplor (meshes), https://github.com/riccardomarin/SHREC19_matching_humans "
    "(original meshes and maps; CC BY-NC 4.0)",
)
PLAIN = Kind("plain", "plain folder", "your own files")

KINDS: tuple[Kind, ...] = (MPI_FAUST, ACD_FAUST, ACD_SCAPE, LPS, SGA18_FAUST, SGA18_TOSCA, SHREC19, PLAIN)

N_FAUST = 6890
"""Vertices of the FAUST registrations, which are the SMPL template's."""

LPS_SIZES = (8000, 10000, 12000, 15000)
"""Vertices of the resolutions of LPS-data."""

# Names of the shapes that each set has as published; SCAPE never had a mesh051.
FAUST_NAMES = tuple(f"tr_reg_{i:03d}" for i in range(100))
SCAPE_NAMES = tuple(f"mesh{i:03d}" for i in range(72) if i != 51)
SHREC19_NAMES = tuple(str(i) for i in range(1, 45))
