"""ICP, ZoomOut and its bijective form, against plain NumPy and on pairs whose map is known."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from csm.errors import ConfigError
from csm.matching.functional import functional_map, orthogonal
from csm.matching.nearest import Nearest
from csm.matching.refinement.pair import Pair
from csm.matching.refinement.zoomout import ICP, Bijective, ZoomOut, adjoint_rows, zoomout_sizes
from tests.matching.pairs import as_map, described, known, relabelled
from tests.matching.peers import geomfum_basis, geomfum_converters, need, same_map
from tests.shapes import blob, cylinder, sphere


def bases(found) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    pair = Pair.of(found.source, found.target)
    here, there = (np.asarray(e.evecs, dtype=float) for e in (pair.source, pair.target))
    return here, there, pair.source.spectrum.mass, pair.target.spectrum.mass


def pulled(indices: np.ndarray, phi: np.ndarray, psi: np.ndarray, mass: np.ndarray, k: int) -> np.ndarray:
    roots = np.sqrt(mass)[:, None]
    return np.linalg.lstsq(roots * phi[:, :k], roots * psi[indices, :k], rcond=None)[0]


def adjoint_map(matrix: np.ndarray, phi: np.ndarray, psi: np.ndarray) -> np.ndarray:
    k = len(matrix)
    return cdist(phi[:, :k], psi[:, :k] @ matrix.T)


@pytest.mark.parametrize("step", [1, 5])
def test_zoomout_is_what_plain_numpy_makes(store, step):
    found = known(store)
    phi, psi, mass, _ = bases(found)
    indices = found.start.indices
    for k in range(10, 26, step):
        matrix = pulled(indices, phi, psi, mass, k)
        indices = adjoint_map(matrix, phi, psi).argmin(1)
    made = ZoomOut(10, 25, step, samples=0)(found.start, found.source, found.target)
    assert (made.forward.vertex_map.indices == indices).mean() > 0.99
    np.testing.assert_allclose(made.forward.functional_map.matrix, matrix, atol=0.02)


def test_icp_is_what_plain_numpy_makes(store):
    found = known(store)
    phi, psi, mass, _ = bases(found)
    indices = found.start.indices
    for _ in range(4):
        u, _, v = np.linalg.svd(pulled(indices, phi, psi, mass, 12))
        matrix = u @ v
        indices = adjoint_map(matrix, phi, psi).argmin(1)
    made = ICP(12, 3)(found.start, found.source, found.target)
    assert (made.forward.vertex_map.indices == indices).mean() > 0.99
    found = made.forward.functional_map.matrix
    np.testing.assert_allclose(found, matrix, atol=0.02)
    np.testing.assert_allclose(found @ found.T, np.eye(12), atol=1e-5)


def test_bijective_zoomout_solves_for_both_maps_together(store):
    found = known(store)
    phi, psi, a, b = bases(found)
    matrix = pulled(found.start.indices, phi, psi, a, 10)
    for k in (15, 20):
        distances = adjoint_map(matrix, phi, psi)
        there, back = distances.argmin(1), distances.argmin(0)
        left = np.concatenate([np.sqrt(a)[:, None] * phi[:, :k], np.sqrt(b)[:, None] * phi[back, :k]])
        right = np.concatenate([np.sqrt(a)[:, None] * psi[there, :k], np.sqrt(b)[:, None] * psi[:, :k]])
        matrix = np.linalg.lstsq(left, right, rcond=None)[0]
    distances = adjoint_map(matrix, phi, psi)
    made = Bijective(10, 20, 5)(found.start, found.source, found.target)
    np.testing.assert_allclose(made.forward.functional_map.matrix, matrix, atol=0.02)
    assert (made.forward.vertex_map.indices == distances.argmin(1)).mean() > 0.99
    assert (made.backward.vertex_map.indices == distances.argmin(0)).mean() > 0.99


def test_rows_of_the_adjoint_form(store):
    pair = Pair.of(known(store).source, known(store).target)
    matrix = pair.source.evecs[:5, :4]
    queries, rows = adjoint_rows(matrix, pair)
    assert (queries == pair.source.evecs[:, :5]).all()
    np.testing.assert_allclose(rows, pair.target.evecs[:, :4] @ matrix.T)


@pytest.mark.parametrize("refiner", [ZoomOut(), ZoomOut(samples=60), ICP(25), Bijective()])
def test_a_relabelled_copy_is_mapped_by_the_relabelling(store, refiner):
    mesh = blob(2)
    other, truth = relabelled(mesh)
    source, target = described(mesh, store), described(other, store)
    made = refiner(Nearest()(source, target), source, target)
    assert (made.forward.vertex_map.indices == truth).mean() >= 0.99


@pytest.mark.parametrize("refiner", [ZoomOut(10, 25, 5, samples=80), ICP(15), Bijective(10, 25, 5)])
def test_each_mends_a_start(store, refiner):
    found = known(store)
    vertices = found.target.mesh.vertices

    def off(indices: np.ndarray) -> float:
        return float(np.linalg.norm(vertices[indices] - vertices[found.truth], axis=1).mean())

    made = refiner(found.start, found.source, found.target)
    assert off(made.forward.vertex_map.indices) < 0.4 * off(found.start.indices)
    assert (made.forward.vertex_map.source, made.forward.vertex_map.target) == ("blob", found.target.mesh.name)


@pytest.mark.parametrize("refiner", [ZoomOut(), ICP(), Bijective()])
@pytest.mark.parametrize("meshes", [(sphere(0), sphere(1)), (cylinder(n=8, m=5), sphere(0))])
def test_small_and_open_meshes_are_mapped(store, refiner, meshes):
    source, target = (described(mesh, store, mesh.vertices) for mesh in meshes)
    made = refiner(Nearest()(source, target), source, target)
    assert made.forward.vertex_map.indices.shape == (meshes[0].n_vertices,)
    k = min(source.embedded.k, target.embedded.k)
    assert made.forward.functional_map.matrix.shape == (k, k)


def test_sizes_end_with_the_last_that_there_is():
    assert zoomout_sizes(20, 60, 20, 200) == [20, 40, 60]
    assert zoomout_sizes(20, 50, 20, 200) == [20, 40, 50]
    assert zoomout_sizes(20, 200, 10, 20) == [20]
    assert zoomout_sizes(20, 200, 10, 7) == [7]


@pytest.mark.parametrize(
    ("kind", "wrong"),
    [
        *((ZoomOut, wrong) for wrong in ({"first": 1}, {"first": 30, "last": 20}, {"step": 0}, {"samples": -1})),
        *((Bijective, wrong) for wrong in ({"first": 1}, {"first": 30, "last": 20}, {"step": 0})),
        *((ICP, wrong) for wrong in ({"k": 1}, {"iterations": 0})),
    ],
)
def test_wrong_parameters_are_refused(kind, wrong):
    with pytest.raises(ConfigError, match="wanted"):
        kind(**wrong)


@pytest.fixture
def human_pair(store, small_humans, small_spectra):
    """The humans with their coordinates for features, a rough start, and what the peers are given."""
    source, target = (described(shape.mesh, store, shape.mesh.vertices) for shape in small_humans)
    here, there = (each.embedded.spectrum for each in (source, target))
    rng = np.random.default_rng(3)
    truth = small_spectra[2]
    rough = np.where(rng.random(len(truth)) < 0.3, rng.integers(0, len(here.mass), len(truth)), truth)
    return as_map(rough, source, target), source, target, here, there


@pytest.mark.peers
@pytest.mark.parametrize(("first", "step", "rounds"), [(20, 5, 8), (30, 1, 10)])
def test_zoomout_is_that_of_pyfm_and_geomfum(human_pair, first, step, rounds):
    start, source, target, here, there = human_pair
    made = ZoomOut(first, first + step * rounds, step, samples=0)(start, source, target)
    begun = functional_map(start.indices, here, there, first)
    matrix, wanted = need("pyFM.refine").zoomout_refine(
        begun, there.evecs, here.evecs, nit=rounds, step=step, A2=here.mass, return_p2p=True
    )
    assert same_map(made.forward.vertex_map.indices, wanted)
    np.testing.assert_allclose(made.forward.functional_map.matrix, matrix, atol=0.05)
    refine = need("geomfum.refine").ZoomOut(nit=rounds, step=step, **geomfum_converters())
    np.testing.assert_allclose(
        made.forward.functional_map.matrix, refine(begun, geomfum_basis(there), geomfum_basis(here)), atol=0.05
    )


@pytest.mark.peers
def test_icp_is_that_of_pyfm_and_geomfum(human_pair):
    start, source, target, here, there = human_pair
    made = ICP(25, 6)(start, source, target)
    begun = orthogonal(functional_map(start.indices, here, there, 25))
    matrix, wanted = need("pyFM.refine").icp_refine(
        begun, there.evecs, here.evecs, A2=here.mass, nit=6, return_p2p=True
    )
    assert same_map(made.forward.vertex_map.indices, wanted)
    np.testing.assert_allclose(made.forward.functional_map.matrix, matrix, atol=0.05)
    theirs = need("geomfum.refine")
    rotate = theirs.OrthogonalRefiner(flip_neg_det=False)
    refine = theirs.IterativeRefiner(nit=6, iter_refiner=rotate, **geomfum_converters())
    np.testing.assert_allclose(
        made.forward.functional_map.matrix, refine(begun, geomfum_basis(there), geomfum_basis(here)), atol=0.05
    )
