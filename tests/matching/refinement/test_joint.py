"""Joint refinement, against plain NumPy and on pairs whose map is known."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from scipy.spatial.distance import cdist

from csm.errors import ConfigError
from csm.matching.nearest import Nearest
from csm.matching.refinement.joint import Climb, Joint, first_matrix
from csm.matching.refinement.pair import Pair
from tests.matching.pairs import as_map, described, known, relabelled
from tests.shapes import blob, plane, sphere


def plain(found, schedule: tuple[int, ...], weight: float, orthogonal: bool) -> tuple[np.ndarray, np.ndarray]:
    """The same in NumPy: least squares at all vertices, nearest in [Phi_s C / sqrt(K), w d]."""
    pair = Pair.of(found.source, found.target)
    phi, psi = (np.asarray(e.evecs, dtype=float) for e in (pair.source, pair.target))
    d, e = (weight * np.asarray(f, dtype=float) for f in (pair.features_source, pair.features_target))
    roots, indices = np.sqrt(pair.source.spectrum.mass)[:, None], found.start.indices
    for k in schedule:
        matrix = np.linalg.lstsq(roots * phi[:, :k], roots * psi[indices, :k], rcond=None)[0]
        if orthogonal:
            u, _, v = np.linalg.svd(matrix)
            matrix = u @ v
        here, there = phi[:, :k] @ matrix / np.sqrt(k), psi[:, :k] / np.sqrt(k)
        indices = cdist(np.hstack([here, d]), np.hstack([there, e])).argmin(1)
    return indices, matrix


@pytest.mark.parametrize("weight", [0.0, 0.8])
@pytest.mark.parametrize("orthogonal", [False, True])
def test_it_is_what_plain_numpy_makes(store, weight, orthogonal):
    found = known(store)
    made = Joint((8, 12, 20), weight, orthogonal)(found.start, found.source, found.target)
    wanted, matrix = plain(found, (8, 12, 20), weight, orthogonal)
    assert (made.forward.vertex_map.indices == wanted).mean() > 0.99
    np.testing.assert_allclose(made.forward.functional_map.matrix, matrix, atol=0.02)
    assert "3 steps, to functional maps of 20 functions" in made.text


def test_it_mends_a_start_and_keeps_what_the_descriptor_knows(store):
    found = known(store)
    made = Joint()(found.start, found.source, found.target)
    mesh = found.target.mesh
    off = np.linalg.norm(mesh.vertices[made.forward.vertex_map.indices] - mesh.vertices[found.truth], axis=1)
    begun = np.linalg.norm(mesh.vertices[found.start.indices] - mesh.vertices[found.truth], axis=1)
    assert off.mean() < 0.2 * begun.mean()
    back = made.forward.vertex_map.compose(made.backward.vertex_map).indices
    assert (back == np.arange(len(back))).mean() > 0.5


def test_a_mesh_goes_to_itself_and_to_a_relabelled_copy_by_the_relabelling(store):
    mesh = blob(2)
    other, truth = relabelled(mesh)
    source, target = described(mesh, store), described(other, store)
    for there, wanted in ((source, np.arange(len(truth))), (target, truth)):
        start = Nearest()(source, there)
        made = Joint()(start, source, there)
        assert (made.forward.vertex_map.indices == wanted).mean() >= 0.99
        assert (made.backward.vertex_map.indices[wanted] == np.arange(len(wanted))).mean() >= 0.99


@pytest.mark.parametrize("meshes", [(sphere(0), sphere(0)), (plane(8), plane(8)), (blob(2), sphere(1))])
def test_small_open_and_different_meshes_are_mapped(store, meshes):
    source, target = (described(mesh, store, mesh.vertices[:, :1]) for mesh in meshes)
    made = Joint()(Nearest()(source, target), source, target)
    assert made.forward.vertex_map.indices.shape == (meshes[0].n_vertices,)
    assert made.backward.vertex_map.indices.shape == (meshes[1].n_vertices,)
    k = min(source.embedded.k, target.embedded.k)
    assert made.forward.functional_map.matrix.shape == (min(k, 30), min(k, 30))


def test_a_start_with_gaps_is_enough(store):
    found = known(store, wrong=0)
    gaps = np.where(np.arange(len(found.truth)) % 2, -1, found.truth)
    made = Joint()(as_map(gaps, found.source, found.target), found.source, found.target)
    whole = Joint()(found.start, found.source, found.target)
    assert (made.forward.vertex_map.indices == whole.forward.vertex_map.indices).mean() > 0.9


def test_first_matrix_is_that_of_the_given_map(store):
    found = known(store)
    pair = Pair.of(found.source, found.target)
    _, wanted = plain(found, (10,), 0.0, False)
    matrix = first_matrix(found.start.indices, pair, 10)
    assert matrix.dtype == torch.float32
    np.testing.assert_allclose(matrix, wanted, atol=1e-3)


def test_sizes_beyond_the_eigenfunctions_are_left_out():
    climb = Climb((10, 20, 40))
    assert climb.sizes(100) == [10, 20, 40]
    assert climb.sizes(39) == [10, 20]
    assert climb.sizes(7) == [7]


@pytest.mark.parametrize(
    "wrong",
    [{"schedule": ()}, {"schedule": (1, 5)}, {"schedule": (20, 10)}, {"weight": -1.0}, {"weight": float("nan")}],
)
def test_wrong_parameters_are_refused(wrong):
    with pytest.raises(ConfigError, match="wanted"):
        Joint(**wrong)


def test_lists_become_tuples_so_that_a_refiner_is_a_key():
    assert Joint([10, 20]) == Joint((10, 20))
    assert hash(Joint([10, 20])) == hash(Joint((10, 20)))
    assert Joint((10, 20), 0.5).parameters() == {"schedule": (10, 20), "weight": 0.5, "orthogonal": True}
