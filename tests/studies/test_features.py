from __future__ import annotations

import numpy as np

from csm.data.prepare import compute_features
from csm.data.store import Store
from csm.descriptors import preset
from csm.operators import bundle
from csm.studies.features import fill
from tests.studies.toys import Toys

DESCRIPTORS = [
    preset("wks", k=40),
    preset("weds", k=40, n_filters=8, levels=2),
    preset("acd_paper", angles=3),
    preset("hks", k=30),
]


def test_descriptors_are_in_the_store_as_if_made_one_by_one(tmp_path):
    assert fill(Toys(), Toys().names, DESCRIPTORS, Store(tmp_path / "together"), 0) == {}
    store = Store(tmp_path / "together")
    assert len(store.files()) == len(DESCRIPTORS) * 3
    mesh = Toys().load("toy1").mesh
    for descriptor in DESCRIPTORS:
        kept = compute_features(mesh, descriptor, store)
        alone = compute_features(mesh, descriptor, Store(tmp_path / "alone"))
        np.testing.assert_allclose(kept, alone, rtol=1e-4, atol=1e-4 * np.abs(alone).max())
    assert store.computed == 0


def test_one_spectrum_of_the_isotropic_laplacian_serves_all(tmp_path, monkeypatch):
    solved = []
    honest = bundle.eigenpairs
    monkeypatch.setattr(bundle, "eigenpairs", lambda *a, **k: solved.append(a[2]) or honest(*a, **k))
    fill(Toys(), ["toy0"], DESCRIPTORS, Store(tmp_path), 0)
    assert solved == [41, 10, 10, 10]
    fill(Toys(), ["toy0"], DESCRIPTORS, Store(tmp_path), 0)
    assert len(solved) == 4


def test_a_shape_that_cannot_be_described_is_named_and_the_others_are_made(tmp_path):
    class OneBad(Toys):
        def load(self, name):
            shape = super().load(name)
            if name == "toy1":
                object.__setattr__(shape.mesh, "vertices", shape.mesh.vertices * np.nan)
            return shape

    failed = fill(OneBad(), Toys().names, DESCRIPTORS[2:3], Store(tmp_path), 0)
    assert list(failed) == ["toy1"]
    assert len(Store(tmp_path).files()) == 2
