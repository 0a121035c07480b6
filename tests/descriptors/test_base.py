from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from csm.descriptors import ACD, GPS, HKS, SHOT, SMWD, WEDS, WKS, Descriptor, Stack
from csm.descriptors.base import as_operators, eigenpairs
from csm.operators import Operators
from tests.shapes import blob, rotation

SMALL = [
    ACD(angles=4, k=10),
    ACD(alpha=4.0, angles=3, k=30, order=5, normalise=True),
    ACD(alpha=0.0, angles=1, k=20),
    HKS(k=40, n_times=10),
    WKS(k=40, n_energies=30),
    WKS(k=40, n_energies=40, variant="functional_map"),
]

each = pytest.mark.parametrize("descriptor", SMALL, ids=repr)


@each
def test_rows_columns_and_plain_parameters(descriptor):
    mesh = blob(2)
    features = descriptor(mesh)
    assert features.values.shape == (mesh.n_vertices, len(features.columns))
    assert len(set(features.columns)) == len(features.columns)
    assert np.isfinite(features.values).all()
    assert isinstance(descriptor, Descriptor)
    assert type(descriptor)(**json.loads(json.dumps(descriptor.parameters()))) == descriptor


@each
def test_rigid_motion_changes_nothing(descriptor):
    mesh = blob(3)
    moved = replace(mesh, vertices=mesh.vertices @ rotation(5).T + np.array([1.0, 2.0, 3.0]))
    before = descriptor(mesh).values
    np.testing.assert_allclose(descriptor(moved).values, before, atol=1e-6 * np.abs(before).max())


@each
def test_scale_changes_nothing_at_unit_area_and_only_a_factor_without(descriptor):
    mesh = blob(3)
    big = replace(mesh, vertices=3.0 * mesh.vertices)
    before = descriptor(mesh).values
    np.testing.assert_allclose(descriptor(big).values, before, atol=1e-6 * np.abs(before).max())
    if isinstance(descriptor, WKS):
        return  # its bounds are logarithms: "/ 1.02" and the clamp at 1e-6 have a unit
    raw, raw_big = (descriptor(Operators(m, unit_area=False)).values for m in (mesh, big))
    factor = np.abs(raw_big).max() / np.abs(raw).max()
    np.testing.assert_allclose(raw_big, factor * raw, atol=1e-6 * np.abs(raw_big).max())


@each
def test_numbering_of_vertices_only_reorders_the_rows(descriptor):
    mesh = blob(3)
    new_of_old = np.random.default_rng(0).permutation(mesh.n_vertices)
    vertices = np.empty_like(mesh.vertices)
    vertices[new_of_old] = mesh.vertices
    before, after = (
        descriptor(mesh).values,
        descriptor(replace(mesh, vertices=vertices, faces=new_of_old[mesh.faces])).values,
    )
    np.testing.assert_allclose(after[new_of_old], before, atol=1e-6 * np.abs(before).max())


@each
def test_signs_of_eigenvectors_change_nothing(descriptor, monkeypatch):
    mesh = blob(2)
    before = descriptor(mesh).values
    honest = Operators._spectrum

    def flipped(self, *args):
        found = honest(self, *args)
        return replace(found, evecs=found.evecs * np.where(np.arange(found.evecs.shape[1]) % 2, -1.0, 1.0))

    monkeypatch.setattr(Operators, "_spectrum", flipped)
    np.testing.assert_array_equal(descriptor(mesh).values, before)


def test_operators_are_used_as_they_are():
    operators = Operators(blob(2), unit_area=False)
    assert as_operators(operators) is operators
    assert as_operators(blob(2)).mesh.area == pytest.approx(1)


ASKING = [
    ACD(angles=4, k=10),
    HKS(k=40),
    SMWD(k=20),
    WEDS(k=50),
    GPS(k=7),
    SHOT(),
    Stack({"a": GPS(k=7), "b": HKS(k=9)}),
]


@pytest.mark.parametrize("descriptor", ASKING, ids=lambda descriptor: descriptor.name)
def test_a_descriptor_says_how_many_eigenpairs_it_asks_for(descriptor, monkeypatch):
    asked = [0]
    solve = Operators._solve
    monkeypatch.setattr(Operators, "_solve", lambda self, matrix, k: asked.append(k) or solve(self, matrix, k))
    descriptor(blob(3))
    assert max(asked) == eigenpairs(descriptor)
