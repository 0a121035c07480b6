from __future__ import annotations

import pytest
import torch

from csm.mesh.topology import directed_edges
from csm.networks import SplineCNN, Surface, stencils_of
from csm.networks.splinecnn import SplineConv, spline_messages
from csm.operators import Operators
from csm.operators.stencils.edge_splines import pseudo_coordinates
from tests.shapes import blob, plane
from tests.surfaces import surface_of


def spline_surface(mesh, kernel: int = 5) -> Surface:
    return surface_of(mesh, 4, stencils_of("splinecnn", kernel=kernel))


def edge_by_edge(mesh, kernel: int, conv: SplineConv, x: torch.Tensor) -> torch.Tensor:
    """The convolution as the paper writes it: one weight matrix per edge, summed over all control points."""
    mesh = Operators(mesh).mesh
    edges = directed_edges(mesh.faces, mesh.n_vertices)
    u = torch.as_tensor(pseudo_coordinates(mesh, edges))
    y = torch.zeros(len(x), conv.weight.shape[2], dtype=x.dtype)
    for target, source, place in zip(edges.targets, edges.sources, u, strict=True):
        hats = torch.clamp(1 - (place[:, None] * (kernel - 1) - torch.arange(kernel)).abs(), min=0)
        basis = torch.einsum("a,b,c->cba", *hats).flatten()  # the first axis runs fastest
        y[target] += torch.einsum("i,m,mio->o", x[source], basis, conv.weight)
    if conv.aggregate == "mean":
        y /= torch.bincount(torch.as_tensor(edges.targets), minlength=len(x))[:, None]
    return y + x @ conv.root.weight.T + conv.bias


def test_parameter_count():
    assert sum(p.numel() for p in SplineCNN(1, 6890).parameters()) == 4_114_186


@pytest.mark.parametrize("aggregate", ["sum", "mean"])
@pytest.mark.parametrize(("mesh", "kernel"), [(blob(1), 5), (plane(5), 3)], ids=["closed", "open"])
def test_against_a_loop_over_the_edges(mesh, kernel, aggregate):
    torch.manual_seed(0)
    conv = SplineConv(3, 4, kernel, aggregate).double()
    conv.bias.data.normal_()
    x = torch.randn(mesh.n_vertices, 3, dtype=torch.float64)
    y = conv(x, spline_surface(mesh, kernel).stencil("edge_splines"))
    torch.testing.assert_close(y, edge_by_edge(mesh, kernel, conv, x))


def test_gradients_in_float64():
    torch.manual_seed(0)
    mesh = plane(4)
    stencil = spline_surface(mesh, 3).stencil("edge_splines")
    x = torch.randn(mesh.n_vertices, 2, dtype=torch.float64, requires_grad=True)
    weight = torch.randn(27, 2, 3, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(lambda v, w: spline_messages(v, w, stencil), (x, weight))
    assert torch.autograd.gradcheck(lambda w: spline_messages(x.detach(), w, stencil), (weight,))


@pytest.mark.parametrize("aggregate", ["sum", "mean"])
def test_every_parameter_learns(aggregate):
    torch.manual_seed(0)
    net = SplineCNN(1, 30, (8, 8), 12, aggregate=aggregate).double()
    surface = spline_surface(blob(2))
    ones = torch.ones(surface.n_vertices, 1, dtype=torch.float64)
    assert net.describe(ones, surface).shape == (162, 12)
    net(ones, surface).square().sum().backward()
    assert all(p.grad is not None and p.grad.abs().max() > 0 for p in net.parameters())


def test_relabelling_the_vertices_permutes_the_descriptor():
    torch.manual_seed(0)
    mesh = blob(2)
    order = torch.randperm(mesh.n_vertices)
    place = torch.argsort(order)
    moved = type(mesh)(mesh.vertices[order.numpy()], place.numpy()[mesh.faces])
    net = SplineCNN(3, 30).double().eval()
    x = torch.randn(mesh.n_vertices, 3, dtype=torch.float64)
    before = net.describe(x, spline_surface(mesh))
    torch.testing.assert_close(net.describe(x[order], spline_surface(moved)), before[order])


def test_other_aggregates_are_refused():
    with pytest.raises(ValueError, match="mean"):
        SplineConv(1, 1, aggregate="max")  # type: ignore[arg-type]
