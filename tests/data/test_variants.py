from __future__ import annotations

import numpy as np
import pytest

from csm.data.store import Store
from csm.data.variants import remeshed
from tests.shapes import blob


@pytest.mark.parametrize(("variant", "n_vertices"), [("refined", 900), ("remeshed", 300)])
def test_each_vertex_of_the_original_has_a_place_and_it_is_computed_once(tmp_path, variant, n_vertices):
    mesh, store = blob(3), Store(tmp_path)
    made = remeshed(mesh, variant, n_vertices, 0, store)
    assert made["truth"].shape == (mesh.n_vertices,)
    assert 0.7 < len(made["vertices"]) / n_vertices < 1.3
    moved = np.linalg.norm(made["vertices"][made["truth"]] - mesh.vertices, axis=1)
    assert moved.max() < 0.4
    before = store.computed
    np.testing.assert_array_equal(remeshed(mesh, variant, n_vertices, 0, store)["faces"], made["faces"])
    assert store.computed == before
