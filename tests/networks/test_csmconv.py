from __future__ import annotations

import numpy as np
import pytest
import torch

from csm.networks import Basis, CSMConv
from csm.networks.csmconv import chebyshev
from csm.operators.operators import Operators
from tests.shapes import blob


def basis_of(mesh, k: int) -> Basis:
    spectrum = Operators(mesh).lbo(k)
    return Basis(*(torch.as_tensor(np.array(a)) for a in (spectrum.evals, spectrum.evecs, spectrum.mass)))


@pytest.fixture(scope="module")
def full() -> Basis:
    """All eigenpairs of a small mesh, in float64."""
    mesh = blob(2)
    return basis_of(mesh, mesh.n_vertices)


def layer(bias="spatial", terms=4) -> CSMConv:
    torch.manual_seed(0)
    conv = CSMConv(3, 5, terms, bias).double()
    conv.bias.data.normal_()
    return conv


def test_chebyshev_is_cos_d_arccos():
    x = torch.linspace(-1, 1, 50, dtype=torch.float64)
    d = torch.arange(7, dtype=torch.float64)[:, None]
    torch.testing.assert_close(chebyshev(x, 7), torch.cos(d * torch.arccos(x)), atol=1e-12, rtol=0)
    assert chebyshev(x, 1).shape == (1, 50)


def test_with_all_eigenpairs_it_is_the_dense_polynomial_of_the_laplacian(full):
    n = len(full.mass)
    laplacian = full.evecs @ torch.diag(full.evals) @ full.evecs.T @ torch.diag(full.mass)
    scaled = 2 * laplacian / full.evals[-1] - torch.eye(n, dtype=torch.float64)
    x = torch.randn(n, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(1))
    conv = layer()
    powers = [torch.eye(n, dtype=torch.float64), scaled]
    while len(powers) < 4:
        powers.append(2 * scaled @ powers[-1] - powers[-2])
    expected = sum(p @ x @ w for p, w in zip(powers, conv.weight, strict=True)) + conv.bias
    torch.testing.assert_close(conv(x, full), expected, atol=1e-9, rtol=1e-9)


def test_eigenvector_signs_do_not_matter_with_a_spatial_bias_and_do_with_a_spectral_one(full):
    basis = full.first(20)
    signs = torch.where(torch.arange(20) % 2 == 0, 1.0, -1.0).double()
    flipped = basis._replace(evecs=basis.evecs * signs)
    x = torch.randn(len(full.mass), 3, dtype=torch.float64)
    torch.testing.assert_close(layer()(x, basis), layer()(x, flipped), atol=1e-12, rtol=0)
    assert (layer("spectral")(x, basis) - layer("spectral")(x, flipped)).abs().max() > 1e-2


def test_rotation_inside_an_eigenspace_does_not_matter(full):
    basis = full.first(20)
    evals = basis.evals.clone()
    evals[5:8] = evals[6]
    turn, _ = torch.linalg.qr(torch.randn(3, 3, dtype=torch.float64))
    evecs = basis.evecs.clone()
    evecs[:, 5:8] = evecs[:, 5:8] @ turn
    x = torch.randn(len(full.mass), 3, dtype=torch.float64)
    same = layer()(x, basis._replace(evals=evals, evecs=evecs))
    torch.testing.assert_close(layer()(x, basis._replace(evals=evals)), same, atol=1e-12, rtol=0)


def test_filters_are_what_the_layer_applies(full):
    basis, conv = full.first(15), layer()
    x = torch.randn(len(full.mass), 3, dtype=torch.float64)
    by_filters = torch.einsum("ki,kio->ko", basis.project(x), conv.filters(basis.evals))
    torch.testing.assert_close(conv(x, basis), basis.synthesize(by_filters) + conv.bias)


def test_gradients_in_float64(full):
    basis, conv = full.first(6), layer(terms=3)
    x = torch.randn(len(full.mass), 3, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(lambda v: conv(v, basis)[:9], (x,))


def test_too_few_eigenpairs_and_bad_options_are_named(full):
    with pytest.raises(ValueError, match=r"wants 9999 eigenpairs, the basis holds"):
        full.first(9999)
    with pytest.raises(ValueError, match="spatial"):
        CSMConv(1, 1, bias="both")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="at least one"):
        CSMConv(1, 1, terms=0)
