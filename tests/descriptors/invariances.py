"""What a descriptor must not notice: one check each, to be called on small settings of any descriptor."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from csm.descriptors import Descriptor, from_parameters
from csm.descriptors.base import record
from csm.mesh.shape import Mesh
from csm.operators import Operators
from tests.shapes import blob, rotation


def assert_close(after: np.ndarray, before: np.ndarray, tolerance: float = 1e-6) -> None:
    """Equal up to `tolerance` of each column's greatest value."""
    greatest = np.abs(before).max(axis=0)
    assert (np.abs(after - before).max(axis=0) <= tolerance * greatest).all()


def mirrored(mesh: Mesh) -> Mesh:
    return replace(mesh, vertices=mesh.vertices * np.array([-1.0, 1.0, 1.0]), faces=mesh.faces[:, ::-1])


def columns_and_parameters(descriptor: Descriptor) -> None:
    mesh = blob(2)
    features = descriptor(mesh)
    assert features.values.shape == (mesh.n_vertices, len(features.columns))
    assert len(set(features.columns)) == len(features.columns)
    assert np.isfinite(features.values).all()
    assert isinstance(descriptor, Descriptor)
    assert from_parameters(**json.loads(json.dumps(record(descriptor)))) == descriptor


def rigid_motion(descriptor: Descriptor) -> None:
    mesh = blob(3)
    moved = replace(mesh, vertices=mesh.vertices @ rotation(5).T + np.array([1.0, 2.0, 3.0]))
    assert_close(descriptor(moved).values, descriptor(mesh).values)


def size(descriptor: Descriptor) -> None:
    mesh = blob(3)
    assert_close(descriptor(replace(mesh, vertices=3.0 * mesh.vertices)).values, descriptor(mesh).values)


def numbering(descriptor: Descriptor) -> None:
    mesh = blob(3)
    new_of_old = np.random.default_rng(0).permutation(mesh.n_vertices)
    vertices = np.empty_like(mesh.vertices)
    vertices[new_of_old] = mesh.vertices
    after = descriptor(replace(mesh, vertices=vertices, faces=new_of_old[mesh.faces])).values
    assert_close(after[new_of_old], descriptor(mesh).values)


def signs_of_eigenvectors(descriptor: Descriptor) -> None:
    mesh = blob(2)
    before = descriptor(mesh).values
    honest = Operators._spectrum

    def flipped(self, *args):
        found = honest(self, *args)
        return replace(found, evecs=found.evecs * np.where(np.arange(found.evecs.shape[1]) % 2, -1.0, 1.0))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Operators, "_spectrum", flipped)
        assert_close(descriptor(mesh).values, before, 1e-12)


CHECKS = (columns_and_parameters, rigid_motion, size, numbering, signs_of_eigenvectors)
