"""What holds for every preset: how it answers to motion, scale, mirror images and another numbering of the vertices."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from csm.descriptors import PRESETS
from csm.mesh.shape import Mesh
from tests.shapes import blob, rotation

EIGENPAIRS = {"k": 24}  # enough for a property, few enough for all presets
WORLD_AXES = ["acd_release_frame"]  # reproduces a published dependence on the world axes
ANISOTROPIC = ["acd_both", "acd_paper", "acd_release", "acd_release_frame", "asmwd", "awft"]


def values(name: str, mesh: Mesh) -> np.ndarray:
    """Columns over their greatest entry, so that one tolerance serves all families."""
    descriptor = PRESETS[name]
    few = {
        key: min(value, descriptor.parameters()[key]) for key, value in EIGENPAIRS.items() if hasattr(descriptor, key)
    }
    found = replace(descriptor, **few)(mesh).values
    assert np.isfinite(found).all()
    return found / np.abs(found).max(axis=0).clip(1e-12)


@pytest.fixture(scope="module")
def plain() -> dict[str, np.ndarray]:
    return {name: values(name, blob(3)) for name in PRESETS}


@pytest.mark.parametrize("name", [name for name in PRESETS if name not in WORLD_AXES])
def test_rigid_motion_changes_nothing(plain, name):
    mesh = blob(3)
    moved = replace(mesh, vertices=mesh.vertices @ rotation(5).T + np.array([1.0, -2.0, 0.5]))
    np.testing.assert_allclose(values(name, moved), plain[name], atol=1e-5)


@pytest.mark.parametrize("name", [name for name in PRESETS if name != "amks"])  # its time is absolute
def test_scale_changes_nothing(plain, name):
    mesh = blob(3)
    np.testing.assert_allclose(values(name, replace(mesh, vertices=3 * mesh.vertices)), plain[name], atol=1e-5)


@pytest.mark.parametrize("name", list(PRESETS))
def test_numbering_of_the_vertices_plays_no_part(plain, name):
    mesh = blob(3)
    new_of_old = np.random.default_rng(0).permutation(mesh.n_vertices)
    vertices = np.empty_like(mesh.vertices)
    vertices[new_of_old] = mesh.vertices
    np.testing.assert_allclose(values(name, Mesh(vertices, new_of_old[mesh.faces]))[new_of_old], plain[name], atol=1e-5)


@pytest.mark.parametrize("name", list(PRESETS))
def test_only_frames_and_chirality_tell_a_mirror_image(plain, name):
    mesh = blob(3)
    mirrored = values(name, Mesh(mesh.vertices @ np.diag([-1.0, 1.0, 1.0]), mesh.faces[:, ::-1]))
    change = np.abs(mirrored - plain[name]).max()
    if name in (*ANISOTROPIC, "shot"):
        assert change > 1e-3
    else:
        assert change < 1e-5
