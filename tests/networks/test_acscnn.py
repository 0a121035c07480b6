from __future__ import annotations

import pytest
import torch

from csm.networks import Basis, Surface, stencils_of
from csm.networks.acscnn import ACSCNN, ACSConv, laplacians_of
from tests.shapes import blob
from tests.surfaces import surface_of

SMALL = {"terms": 4, "angles": 3, "channels": (6, 5), "descriptor_channels": 7}


@pytest.fixture(scope="module")
def surface() -> Surface:
    return surface_of(blob(2), 4, stencils_of("acscnn", **SMALL))


@pytest.mark.parametrize(("inputs", "count"), [(1, 4_418_154), (48, 4_803_178), (140, 5_556_842)])
def test_parameter_counts(inputs, count):
    assert sum(p.numel() for p in ACSCNN(inputs, 6890).parameters()) == count


def layer(terms: int = 4, inputs: int = 2, outputs: int = 3) -> ACSConv:
    torch.manual_seed(0)
    conv = ACSConv(inputs, outputs, terms, angles=3).double()
    conv.bias.data.normal_()
    return conv


def applied(conv: ACSConv, x: torch.Tensor, surface: Surface) -> torch.Tensor:
    return conv(x, laplacians_of(surface), surface.basis.mass.sqrt()[:, None])


@pytest.mark.parametrize("terms", [1, 2, 3, 6])
def test_it_is_the_published_sum_over_terms_of_the_angles_side_by_side(surface, terms):
    conv, x = layer(terms), torch.randn(162, 2, dtype=torch.float64)
    root = surface.basis.mass.sqrt().diag()
    matrices = [root.inverse() @ M.to_dense() @ root for M in laplacians_of(surface)]
    powers = [[torch.eye(162).double(), L] for L in matrices]
    for row, L in zip(powers, matrices, strict=True):
        while len(row) < terms:
            row.append(2 * L @ row[-1] - row[-2])
    expected = conv.bias + sum(torch.cat([row[k] @ x for row in powers], dim=1) @ w for k, w in enumerate(conv.weight))
    torch.testing.assert_close(applied(conv, x, surface), expected)


@pytest.mark.parametrize("terms", [1, 2, 5])
def test_gradients_in_float64(surface, terms):
    conv, x = layer(terms), torch.randn(162, 2, dtype=torch.float64, requires_grad=True)

    def some(v: torch.Tensor, weight: torch.Tensor, bias: torch.Tensor) -> torch.Tensor:
        named = {"weight": weight, "bias": bias}
        arguments = (v, laplacians_of(surface), surface.basis.mass.sqrt()[:, None])
        return torch.func.functional_call(conv, named, arguments)[:7]

    assert torch.autograd.gradcheck(some, (x, conv.weight, conv.bias), fast_mode=True)


def test_features_that_need_no_gradient_change_no_other(surface):
    conv, x = layer(), torch.randn(162, 2, dtype=torch.float64)
    grads = []
    for v in (x, x.clone().requires_grad_()):
        conv.zero_grad()
        applied(conv, v, surface).square().sum().backward()
        grads.append(conv.weight.grad.clone())
    torch.testing.assert_close(*grads)


def test_a_function_reaches_terms_minus_one_rings(surface):
    x = torch.zeros(162, 2, dtype=torch.float64)
    x[0] = 1.0
    near = laplacians_of(surface)[0].to_dense() != 0
    for terms in (1, 2, 3):
        conv = layer(terms)
        reached = (applied(conv, x, surface) - conv.bias).abs().amax(1) > 0
        assert torch.equal(reached, torch.linalg.matrix_power(near.double(), terms - 1)[0] > 0)


def test_the_network_runs_and_every_parameter_learns(surface):
    net = ACSCNN(4, 9, **SMALL).double()
    x = torch.randn(162, 4, dtype=torch.float64)
    assert net.describe(x, surface).shape == (162, 7)
    net(x, surface).square().sum().backward()
    assert all(p.grad is not None and torch.isfinite(p.grad).all() and p.grad.abs().max() > 0 for p in net.parameters())


def test_a_layer_before_the_convolutions_keeps_them_narrow(surface):
    network = ACSCNN(688, 20, lift_channels=6, **SMALL).double()
    assert network.convs[0].weight.shape[1] == 3 * 6
    assert network(torch.randn(162, 688).double(), surface).shape == (162, 20)
    with pytest.raises(ValueError, match="lift_channels is 0 for none"):
        ACSCNN(5, 20, lift_channels=-1)


def test_relabelling_the_vertices_permutes_the_descriptor(surface):
    net = ACSCNN(4, 9, **SMALL).double().eval()
    x, order = torch.randn(162, 4, dtype=torch.float64), torch.randperm(162)
    values = torch.stack([M.to_dense()[order][:, order].to_sparse_csr().values() for M in laplacians_of(surface)])
    pattern = laplacians_of(surface)[0].to_dense()[order][:, order].to_sparse_csr()
    albo = {"indptr": pattern.crow_indices(), "indices": pattern.col_indices(), "values": values}
    basis = Basis(surface.basis.evals, surface.basis.evecs[order], surface.basis.mass[order])
    torch.testing.assert_close(net.describe(x[order], Surface(basis, {"albo": albo})), net.describe(x, surface)[order])


def test_its_stencil_has_the_options_that_concern_it():
    assert ACSCNN(1, 2, alpha=4.0, terms=3).stencils() == {
        "albo": {"alpha": 4.0, "angles": 8, "frame": "line_field", "sweeps": 10, "smoothing": 0.08}
    }


def test_bad_options_are_named():
    with pytest.raises(ValueError, match="at least 1"):
        ACSConv(1, 1, terms=0)
