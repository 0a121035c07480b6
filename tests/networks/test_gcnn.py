from __future__ import annotations

import numpy as np
import pytest
import torch

from csm.networks import GCNN, Surface, gcnn, stencils_of
from csm.networks.gcnn import GeodesicConv, Patches, correlation
from tests.shapes import blob
from tests.surfaces import surface_of

SMALL = {"channels": (4, 6, 8), "descriptor_channels": 12, "radius": 0.1, "rings": 2, "rays": 5}
STENCIL = {key: SMALL[key] for key in ("radius", "rings", "rays")}


def patch_surface(mesh) -> Surface:
    return surface_of(mesh, 1, stencils_of("gcnn", **STENCIL))


def random_patches(n: int = 11, windows: int = 10) -> tuple[Patches, torch.Tensor]:
    """Sparse windows of n vertices, and the same as a dense matrix."""
    matrix = torch.rand(n * windows, n, dtype=torch.float64) * (torch.rand(n * windows, n) < 0.3)
    rows, columns = matrix.nonzero(as_tuple=True)
    counts = torch.bincount(rows, minlength=n * windows)
    indptr = torch.cat([torch.zeros(1, dtype=torch.long), counts.cumsum(0)])
    return Patches(indptr, columns, matrix[rows, columns]), matrix


def turn_by_turn(matrix: torch.Tensor, conv: GeodesicConv, x: torch.Tensor) -> torch.Tensor:
    rings, rays, _, width = conv.weight.shape
    made = (matrix @ x).view(len(x), rings, rays, -1)
    y = torch.full((len(x), width), -torch.inf, dtype=x.dtype)
    for turn in range(rays):
        total = torch.zeros_like(y)
        for s in range(rings):
            for t in range(rays):
                total += made[:, s, (t + turn) % rays] @ conv.weight[s, t]
        y = torch.maximum(y, total)
    return y + conv.bias


def test_parameter_count():
    lift, embed, classifier = 150 * 16 + 16, 128 * 256 + 256, 256 * 6890 + 6890
    convolutions = 80 * (16 * 32 + 32 * 64 + 64 * 128) + 32 + 64 + 128
    batch_norm = 2 * (16 + 32 + 64 + 128 + 256)
    assert sum(p.numel() for p in GCNN(150, 6890).parameters()) == lift + convolutions + embed + batch_norm + classifier


@pytest.mark.parametrize("rays", [1, 4, 5])
def test_correlation_is_a_sum_over_rings_and_rays(rays):
    torch.manual_seed(0)
    patches, weight = torch.randn(3, 2, rays, 4).double(), torch.randn(2, rays, 4, 6).double()
    expected = torch.stack([torch.einsum("bstc,stco->bo", patches.roll(-u, 2), weight) for u in range(rays)], dim=1)
    torch.testing.assert_close(correlation(patches, weight), expected)


@pytest.mark.parametrize("chunk", [3, 512])
def test_against_a_loop_over_turns_rings_and_rays(chunk, monkeypatch):
    monkeypatch.setattr(gcnn, "CHUNK", chunk)
    torch.manual_seed(0)
    patches, matrix = random_patches()
    conv, x = GeodesicConv(3, 4, 2, 5).double(), torch.randn(11, 3, dtype=torch.float64)
    conv.bias.data.normal_()
    torch.testing.assert_close(conv(x, patches), turn_by_turn(matrix, conv, x))


def test_gradients_are_those_of_the_loop(monkeypatch):
    monkeypatch.setattr(gcnn, "CHUNK", 4)
    torch.manual_seed(0)
    patches, matrix = random_patches()
    conv, x = GeodesicConv(3, 4, 2, 5).double(), torch.randn(11, 3, dtype=torch.float64, requires_grad=True)
    leaves, back = (x, *conv.parameters()), torch.randn(11, 4).double()
    found = torch.autograd.grad(conv(x, patches), leaves, back)
    torch.testing.assert_close(found, torch.autograd.grad(turn_by_turn(matrix, conv, x), leaves, back))


def test_it_does_not_matter_which_ray_is_the_first():
    torch.manual_seed(0)
    patches, matrix = random_patches()
    turned = matrix.view(11, 2, 5, 11).roll(2, dims=2).reshape(-1, 11)
    conv, x = GeodesicConv(3, 4, 2, 5).double(), torch.randn(11, 3, dtype=torch.float64)
    torch.testing.assert_close(turn_by_turn(turned, conv, x), conv(x, patches))


def test_every_parameter_learns():
    torch.manual_seed(0)
    net, surface = GCNN(3, 30, **SMALL).double(), patch_surface(blob(1))
    x = torch.randn(42, 3, dtype=torch.float64)
    assert net.describe(x, surface).shape == (42, 12)
    torch.nn.functional.cross_entropy(net(x, surface), torch.arange(42) % 30).backward()
    biases = {f"convs.{i}.bias" for i in range(2)} | {"lift.bias", "embed.bias"}  # batch normalisation takes them away
    for name, p in net.named_parameters():
        assert p.grad is not None
        assert name in biases or p.grad.abs().max() > 1e-9, name


def test_relabelling_the_vertices_permutes_the_descriptor():
    torch.manual_seed(0)
    mesh = blob(1)
    order = torch.randperm(mesh.n_vertices)
    place = torch.argsort(order)
    moved = type(mesh)(mesh.vertices[order.numpy()], place.numpy()[mesh.faces])
    net, x = GCNN(3, 30, **SMALL).double().eval(), torch.randn(42, 3, dtype=torch.float64)
    before, after = net.describe(x, patch_surface(mesh)), net.describe(x[order], patch_surface(moved))
    torch.testing.assert_close(after, before[order], atol=1e-5, rtol=1e-4)


def test_a_constant_stays_constant_whatever_the_mesh():
    net = GCNN(2, 30, **SMALL).double().eval()
    ones = torch.ones(42, 2, dtype=torch.float64)
    y = net.describe(ones, patch_surface(blob(1))).detach().numpy()
    np.testing.assert_allclose(y, np.broadcast_to(y[0], y.shape), atol=1e-5)


def test_no_rings_are_refused():
    with pytest.raises(ValueError, match="rings"):
        GeodesicConv(1, 1, rings=0)
