"""csm's meshes and eigenbases as pyFM and geomfum take them, for the tests that compare with these libraries."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy import sparse

from csm.mesh.shape import Mesh
from csm.operators import Spectrum

_WHY = 'compares with pyFM and geomfum, which are not installed: pip install "csm-correspondence[peers]"'


def need(module: str) -> Any:
    """Import a module of pyFM or geomfum, or skip the test."""
    return pytest.importorskip(module, reason=_WHY)


def pyfm_mesh(mesh: Mesh) -> Any:
    return need("pyFM.mesh").TriMesh(mesh.vertices, mesh.faces)


def geomfum_basis(spectrum: Spectrum, k: int | None = None) -> Any:
    """The eigenbasis with csm's own arrays, of which k functions are in use."""
    shape = SimpleNamespace(laplacian=SimpleNamespace(mass_matrix=sparse.diags_array(spectrum.mass)))
    basis = need("geomfum.basis").LaplaceEigenBasis(shape, spectrum.evals, spectrum.evecs)
    basis.use_k = k
    return basis


def geomfum_converters() -> dict[str, Any]:
    """Converters by the masses, as csm has them; geomfum's defaults leave areas out."""
    convert = need("geomfum.convert")
    return {
        "p2p_from_fm_converter": convert.P2pFromFmConverter(),
        "fm_from_p2p_converter": convert.FmFromP2pConverter(pseudo_inverse=True),
    }


def same_map(found: np.ndarray, wanted: np.ndarray) -> bool:
    """Whether two maps are equal but for ties that rounding decides."""
    return bool((np.asarray(found) == np.asarray(wanted)).mean() > 0.98)
