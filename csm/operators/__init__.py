"""Laplacians of a mesh and what they are made of: frames, stiffness, spectra, geodesic distances."""

from csm.operators.operators import Memo, Operators
from csm.operators.spectrum import Spectrum

__all__ = ["Memo", "Operators", "Spectrum"]
