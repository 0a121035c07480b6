from __future__ import annotations

import numpy as np
import pytest

from csm.data.registry import recognise
from csm.data.store import Store
from csm.data.variants import VariantSet, remeshed
from tests.shapes import blob
from tests.toyset import write_toys


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


def test_another_triangulation_keeps_the_places_of_the_template(tmp_path):
    toys = recognise(write_toys(tmp_path / "toys"))
    shapes = VariantSet(toys, "remeshed", 300, str(tmp_path))
    before, after = toys.load("toy0"), shapes.load("toy0")
    assert shapes.name == f"{toys.name}_remeshed_300"
    assert after.mesh.n_vertices != before.mesh.n_vertices
    assert after.truth.n_from == before.truth.n_from
    moved = np.linalg.norm(
        after.mesh.vertices[after.truth.indices] - before.mesh.vertices[before.truth.indices], axis=1
    )
    assert moved.max() < 0.2 * np.ptp(before.mesh.vertices, axis=0).max()
