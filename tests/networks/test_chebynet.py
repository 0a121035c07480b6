from __future__ import annotations

import numpy as np
import pytest
import torch

from csm.networks import ChebyNet, Surface, stencils_of
from csm.networks.chebynet import ChebConv, laplacian_of
from csm.operators.laplacian import stiffness
from csm.operators.stencils.scaled_laplacian import graph_laplacian
from tests.shapes import blob
from tests.surfaces import surface_of


def laplacian_surface(mesh, laplacian: str = "graph") -> Surface:
    return surface_of(mesh, 4, stencils_of("chebynet", laplacian=laplacian))


@pytest.mark.parametrize(("terms", "count"), [(6, 1_898_506), (16, 2_083_146)])
def test_parameter_counts(terms, count):
    assert sum(p.numel() for p in ChebyNet(1, 6890, terms=terms).parameters()) == count


@pytest.mark.parametrize("laplacian", ["graph", "cotangent"])
@pytest.mark.parametrize("terms", [1, 4])
def test_against_cosines_of_the_dense_laplacian(laplacian, terms):
    torch.manual_seed(0)
    mesh = blob(1)
    plain = (stiffness(mesh) if laplacian == "cotangent" else graph_laplacian(mesh)).toarray()
    root = np.sqrt(np.diag(plain))
    evals, evecs = (torch.as_tensor(a) for a in np.linalg.eigh(plain / root / root[:, None]))
    angle = torch.arccos((2 * evals / evals[-1] - 1).clamp(-1, 1))
    conv = ChebConv(3, 5, terms).double()
    conv.bias.data.normal_()
    x = torch.randn(mesh.n_vertices, 3, dtype=torch.float64)
    expected = conv.bias + sum(
        evecs @ torch.diag(torch.cos(d * angle)) @ evecs.T @ x @ w for d, w in enumerate(conv.weight)
    )
    y = conv(x, laplacian_of(laplacian_surface(mesh, laplacian), torch.float64))
    torch.testing.assert_close(y, expected, atol=1e-4, rtol=1e-4)


def test_gradients_in_float64():
    torch.manual_seed(0)
    mesh = blob(1)
    laplacian = laplacian_of(laplacian_surface(mesh), torch.float64)
    conv = ChebConv(2, 3, 4).double()
    x = torch.randn(mesh.n_vertices, 2, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(lambda v, *_: conv(v, laplacian), (x, *conv.parameters()))


def test_a_convolution_of_k_terms_sees_k_less_one_rings():
    mesh = blob(2)
    adjacency = torch.as_tensor(graph_laplacian(mesh).toarray() != 0).double()
    impulse = torch.zeros(mesh.n_vertices, 1, dtype=torch.float64)
    impulse[7] = 1
    reached = (torch.linalg.matrix_power(adjacency, 2) @ impulse)[:, 0] > 0
    conv = ChebConv(1, 4, 3).double()
    y = conv(impulse, laplacian_of(laplacian_surface(mesh), torch.float64))
    assert (y[~reached] == 0).all()
    assert (y[reached] != 0).all()


def test_every_parameter_learns():
    torch.manual_seed(0)
    net = ChebyNet(2, 30, (8, 8), 12, terms=3).double()
    surface = laplacian_surface(blob(2))
    x = torch.randn(surface.n_vertices, 2, dtype=torch.float64)
    assert net.describe(x, surface).shape == (162, 12)
    net(x, surface).square().sum().backward()
    assert all(p.grad is not None and p.grad.abs().max() > 0 for p in net.parameters())


def test_relabelling_the_vertices_permutes_the_descriptor():
    torch.manual_seed(0)
    mesh = blob(2)
    order = torch.randperm(mesh.n_vertices)
    place = torch.argsort(order)
    moved = type(mesh)(mesh.vertices[order.numpy()], place.numpy()[mesh.faces])
    net = ChebyNet(3, 30).double().eval()
    x = torch.randn(mesh.n_vertices, 3, dtype=torch.float64)
    before = net.describe(x, laplacian_surface(mesh))
    torch.testing.assert_close(net.describe(x[order], laplacian_surface(moved)), before[order], atol=1e-5, rtol=1e-5)


def test_bad_options_are_refused():
    with pytest.raises(ValueError, match="cotangent"):
        ChebyNet(1, 4, laplacian="umbrella")
    with pytest.raises(ValueError, match="at least one"):
        ChebConv(1, 1, terms=0)
