"""Operators of a mesh: face frames, anisotropic and isotropic Laplacians, their spectra, geodesic distances."""

from typing import TYPE_CHECKING

from csm._places import lazily

if TYPE_CHECKING:
    from csm.operators.operators import Memo, Operators
    from csm.operators.spectrum import Spectrum

__all__ = ["Memo", "Operators", "Spectrum"]

_PLACES = {
    "csm.operators.operators": ("Memo", "Operators"),
    "csm.operators.spectrum": ("Spectrum",),
}

if not TYPE_CHECKING:
    __getattr__, __dir__ = lazily(__name__, _PLACES)
