"""Operators of a mesh: face frames, anisotropic and isotropic Laplacians, their spectra, geodesic distances."""

from csm.operators.operators import Memo, Operators
from csm.operators.spectrum import Spectrum

__all__ = ["Memo", "Operators", "Spectrum"]
