"""The fit of a functional map, against least squares over all equations written out."""

from __future__ import annotations

import numpy as np
import pytest

from csm.errors import ConfigError
from csm.matching.fit import FitWeights, Side, fit_functional_map
from csm.matching.functional import functional_map
from csm.mesh.debris import unit_area
from csm.mesh.shape import Mesh
from csm.operators import Spectrum
from tests.matching.pairs import bent, mirrored, relabelled, spectrum_of
from tests.matching.peers import need, pyfm_mesh
from tests.matching.test_orientation import by_faces
from tests.shapes import blob

K = 5


def waves(mesh: Mesh, n: int = 3) -> np.ndarray:
    return np.cos(mesh.vertices @ np.random.default_rng(0).normal(size=(3, n)) + np.arange(n)) + 0.2


def side(mesh: Mesh, features: np.ndarray, k: int = 12) -> Side:
    return Side(spectrum_of(mesh, k), features, unit_area(mesh))


@pytest.fixture(scope="module")
def sides() -> tuple[Side, Side]:
    source, target = blob(1), bent(blob(1, seed=3))
    target, _ = relabelled(target)
    return side(source, waves(source)), side(target, 1.3 * waves(target))


def inner(spectrum: Spectrum, f: np.ndarray) -> np.ndarray:
    return np.array([sum(spectrum.mass * spectrum.evecs[:, i] * f) for i in range(K)])


def multiplied(given: Side) -> list[np.ndarray]:
    phi = given.spectrum.evecs
    return [np.stack([inner(given.spectrum, d * phi[:, j]) for j in range(K)], 1) for d in given.features.T]


def turned(given: Side) -> list[np.ndarray]:
    phi, made = given.spectrum.evecs[:, :K], []
    for d in given.features.T:
        smooth = phi @ inner(given.spectrum, d)
        made.append(np.stack([inner(given.spectrum, by_faces(given.mesh, smooth, phi[:, j])) for j in range(K)], 1))
    return made


def written_out(source: Side, target: Side, weights: FitWeights) -> np.ndarray:
    """Stack the equations of all terms, each over its size, for the K x K numbers of the map in rows."""
    unit, rows, right = np.eye(K), [], []
    a, b = (np.stack([inner(s.spectrum, d) for d in s.features.T], 1) for s in (target, source))
    size = np.sqrt((a**2).sum() / K)
    rows.append(np.kron(unit, a.T) / size)
    right.append(b.ravel() / size)
    here, there = (np.diag(s.spectrum.evals[:K]) for s in (source, target))
    gaps = np.kron(unit, there) - np.kron(here, unit)
    rows.append(np.sqrt(weights.laplacian / (np.subtract.outer(np.diag(here), np.diag(there)) ** 2).mean()) * gaps)
    for weight, of in ((weights.descriptors, multiplied), (weights.orientation, turned)):
        xs, ys = of(target), of(source)
        total = sum((m**2).sum() for m in [*xs, *ys]) / (2 * K)
        rows += [np.sqrt(weight / total) * (np.kron(unit, x.T) - np.kron(y, unit)) for x, y in zip(xs, ys, strict=True)]
    right += [np.zeros(len(block)) for block in rows[1:]]
    return np.linalg.lstsq(np.concatenate(rows), np.concatenate(right), rcond=None)[0].reshape(K, K)


@pytest.mark.parametrize(
    "weights", [FitWeights(0.3, 0, 0), FitWeights(0, 0.7, 0), FitWeights(0, 0.1, 0.5), FitWeights(2, 0.4, 1)]
)
def test_it_is_the_least_squares_solution_of_all_terms(sides, weights):
    np.testing.assert_allclose(fit_functional_map(*sides, K, weights), written_out(*sides, weights), atol=2e-5)


def test_without_regularisers_it_carries_the_descriptors_over(sides):
    source, target = sides
    a, b = (np.stack([inner(s.spectrum, d) for d in s.features.T], 1) for s in (target, source))
    found = fit_functional_map(source, target, K, FitWeights(0, 0, 0))
    assert np.linalg.norm(found @ a - b) < 1e-5 * np.linalg.norm(b)
    least = b @ np.linalg.pinv(a)  # of the many matrices that do, the smallest
    np.testing.assert_allclose(found, least, atol=1e-5)


def test_without_weights_it_takes_the_defaults(sides):
    np.testing.assert_array_equal(fit_functional_map(*sides, K), fit_functional_map(*sides, K, FitWeights()))


def test_a_common_scale_of_the_descriptors_changes_nothing(sides):
    weights = FitWeights(0.1, 0.1, 0.1)
    scaled = [Side(s.spectrum, 50 * s.features, s.mesh) for s in sides]
    np.testing.assert_allclose(
        fit_functional_map(*scaled, K, weights), fit_functional_map(*sides, K, weights), atol=1e-6
    )


@pytest.mark.parametrize("weights", [FitWeights(), FitWeights(0.1, 0.1, 0.1)])
def test_of_a_relabelled_copy_it_is_the_map_of_the_relabelling(weights):
    mesh = blob(2)
    other, truth = relabelled(mesh)
    features = waves(mesh, 8)
    moved = np.empty_like(features)
    moved[truth] = features
    source, target = side(mesh, features), side(other, moved)
    wanted = functional_map(truth, source.spectrum, target.spectrum, 10)
    np.testing.assert_allclose(fit_functional_map(source, target, 10, weights), wanted, atol=1e-3)


def test_the_orientation_term_refuses_a_mirror_image():
    """The map vertex i -> vertex i of the image keeps all but the orientation, so only that term pulls away from it."""
    mesh = blob(2)
    features = waves(mesh, 8)
    source, image = side(mesh, features), side(mirrored(mesh), features)
    truth = functional_map(np.arange(mesh.n_vertices), source.spectrum, image.spectrum, 8)

    def off(orientation: float) -> float:
        return float(np.abs(fit_functional_map(source, image, 8, FitWeights(0.1, 0.1, orientation)) - truth).max())

    assert off(0.0) < 1e-3
    assert off(10.0) > 0.3


def test_one_descriptor_is_enough():
    mesh = blob(2)
    given = side(mesh, waves(mesh, 1))
    np.testing.assert_allclose(fit_functional_map(given, given, 4), np.eye(4), atol=1e-2)


def test_descriptors_of_different_number_are_refused(sides):
    source, target = sides
    with pytest.raises(ConfigError, match="2 descriptors of the source and 3 of the target"):
        fit_functional_map(Side(source.spectrum, source.features[:, :2]), target, K)


def test_the_orientation_term_asks_for_the_meshes(sides):
    bare = [Side(s.spectrum, s.features) for s in sides]
    with pytest.raises(ConfigError, match="needs the meshes"):
        fit_functional_map(*bare, K, FitWeights(orientation=1))


@pytest.mark.parametrize("wrong", [{"laplacian": -1}, {"descriptors": -0.1}, {"orientation": -1}])
def test_negative_weights_are_refused(wrong):
    with pytest.raises(ConfigError, match="at least 0"):
        FitWeights(**wrong)


def sizes(x: np.ndarray, y: np.ndarray) -> float:
    return float((x**2).sum() + (y**2).sum()) / (2 * x.shape[-1])


@pytest.mark.peers
@pytest.mark.parametrize("weights", [FitWeights(0.3, 0, 0), FitWeights(0.1, 0.5, 0), FitWeights(0.1, 0.2, 0.4)])
def test_it_minimises_the_energies_of_pyfm_and_geomfum(small_humans, weights):
    """The gradients of both, with their own operators and csm's weights, vanish at csm's minimiser."""
    k = 12
    source, target = (side(shape.mesh, waves(shape.mesh, 6), k) for shape in small_humans)
    found = fit_functional_map(source, target, k, weights)
    a, b = (s.spectrum.evecs.T @ (s.spectrum.mass[:, None] * s.features) for s in (target, source))
    mask = (source.spectrum.evals[:, None] - target.spectrum.evals) ** 2
    products, turns = ([operators(s, k) for s in (target, source)] for operators in (pyfm_products, pyfm_turns))
    terms = (
        k / float((a**2).sum()),
        weights.laplacian / mask.mean(),
        weights.descriptors / sizes(*products),
        weights.orientation / sizes(*turns),
    )
    slope = need("pyFM.optimize").energy_and_grad_std
    given = (*terms, a, b, products, turns, mask)
    energy, gradient = slope(found, *given)
    at_zero, steepest = slope(np.zeros((k, k)), *given)
    assert np.linalg.norm(gradient) < 1e-5 * np.linalg.norm(steepest)
    assert energy < at_zero
    factors = need("geomfum.functional_map")
    theirs = [factors.SpectralDescriptorPreservation(a.T, b.T, terms[0])]
    theirs += [factors.LBCommutativityEnforcing(mask, terms[1])]
    pairs = [(w, *both) for w, of in zip(terms[2:], (products, turns), strict=True) for both in zip(*of, strict=True)]
    theirs += [factors.OperatorCommutativityEnforcing(x, y, w) for w, x, y in pairs]
    total = factors.FactorSum(theirs)
    assert float(total(found)) == pytest.approx(energy)
    assert np.linalg.norm(total.gradient(found)) < 1e-5 * np.linalg.norm(steepest)


def pyfm_products(given: Side, k: int) -> np.ndarray:
    phi = given.spectrum.evecs[:, :k]
    return np.stack([phi.T @ (given.spectrum.mass[:, None] * d[:, None] * phi) for d in given.features.T])


def pyfm_turns(given: Side, k: int) -> np.ndarray:
    """pyFM's orientation operators, of the descriptors as the first k functions see them, as csm smooths them."""
    phi, mass, mesh = given.spectrum.evecs[:, :k], given.spectrum.mass[:, None], pyfm_mesh(given.mesh)
    smooth = phi @ (phi.T @ (mass * given.features))
    return np.stack([phi.T @ (mass * (mesh.orientation_op(mesh.gradient(d)) @ phi)) for d in smooth.T])
