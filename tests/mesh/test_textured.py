from __future__ import annotations

import numpy as np
import pytest

from csm.errors import MeshError
from csm.mesh.textured import Image, Textured
from tests.shapes import sphere

MESH = sphere(1)
M = MESH.n_faces
PICTURE = Image(".png", b"picture")


def test_images_are_on_the_faces_that_have_coordinates():
    uv = np.zeros((M, 3, 2))
    uv[3, 1, 0] = np.nan
    found = Textured(MESH, uv, (PICTURE,))
    assert np.isnan(found.uv[3]).all()
    assert np.flatnonzero(found.image_numbers < 0).tolist() == [3]
    assert len(found.has_uv) == M - 1
    assert (Textured(MESH, uv).image_numbers == -1).all()
    assert repr(found) == "Textured('sphere', 79 of 80 faces with texture coordinates, 1 image)"
    with pytest.raises(ValueError, match="read-only"):
        found.uv[0] = 1


def test_what_does_not_fit_is_refused():
    with pytest.raises(MeshError, match=r"shape \(42, 2\), wanted \(80, 3, 2\)"):
        Textured(MESH, np.zeros((42, 2)))
    with pytest.raises(MeshError, match=r"a face has image 1, counted from 0, but the mesh has 1 image$"):
        Textured(MESH, np.zeros((M, 3, 2)), (PICTURE,), np.ones(M, dtype=int))
