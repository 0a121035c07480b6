from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from csm.networks import Surface, stencils_of
from csm.networks.diffusionnet import LEAST_TIME, Diffusion, DiffusionBlock, DiffusionNet, Gradient, GradientFeatures
from tests.shapes import blob
from tests.surfaces import surface_of

SMALL = {"width": 6, "blocks": 2, "ks": 20}


@pytest.fixture(scope="module")
def surface() -> Surface:
    return surface_of(blob(2), 24, stencils_of("diffusionnet"))


@pytest.fixture
def x() -> torch.Tensor:
    torch.manual_seed(0)
    return torch.randn(162, 6, dtype=torch.float64)


def net(**options) -> DiffusionNet:
    """A network with diffusion times apart from zero, in evaluation mode."""
    torch.manual_seed(1)
    made = DiffusionNet(6, 9, **{**SMALL, **options}).double().eval()
    for block in made.blocks:
        block.diffusion.time.data.uniform_(0.01, 0.1)
    return made


@pytest.mark.parametrize(
    ("inputs", "options", "count"), [(16, {}, 1_351_786), (3, {"width": 256}, 3_610_858), (3, {"blocks": 0}, 889_322)]
)
def test_parameter_counts(inputs, options, count):
    assert sum(p.numel() for p in DiffusionNet(inputs, 6890, **options).parameters()) == count


def test_a_width_of_the_descriptor_adds_one_linear_layer(surface, x):
    assert net().describe(x, surface).shape == (162, 6)
    wide = net(descriptor_channels=11)
    assert wide.describe(x, surface).shape == (162, 11)
    assert wide.classifier.in_features == 11
    assert sum(p.numel() for p in wide.embed.parameters()) == 7 * 11


def test_diffusion_is_the_heat_equation_solved_in_the_span(surface, x):
    basis, layer = surface.basis, Diffusion(6).double()
    layer.time.data = torch.linspace(0.01, 0.2, 6).double()
    evals, evecs, mass = basis
    laplacian = evecs @ evals.diag() @ evecs.T @ mass.diag()
    inside = evecs @ (evecs.T @ (mass[:, None] * x))
    expected = [torch.linalg.matrix_exp(-t * laplacian) @ inside[:, c] for c, t in enumerate(layer.time.tolist())]
    torch.testing.assert_close(layer(x, basis), torch.stack(expected, dim=1))


def test_times_are_kept_above_zero_and_can_leave_it_again(surface, x):
    layer = Diffusion(6).double()
    layer.time.data.fill_(-1.0)
    layer(x, surface.basis).square().sum().backward()
    assert (layer.time == LEAST_TIME).all()
    assert (layer.time.grad < 0).all(), "more diffusion means less energy"


def test_gradient_features_are_complex_products():
    layer = GradientFeatures(3).double()
    gx, gy = torch.randn(2, 5, 3, dtype=torch.float64)
    g, B = torch.complex(gx, gy), torch.complex(layer.real.weight, layer.imaginary.weight)
    torch.testing.assert_close(layer(gx, gy), torch.tanh((g.conj() * (g @ B.T)).real))


def test_turning_the_tangent_frames_changes_nothing_and_mirroring_them_does():
    layer = GradientFeatures(3).double()
    gx, gy = torch.randn(2, 5, 3, dtype=torch.float64)
    angle = torch.rand(5, 1, dtype=torch.float64) * 6
    turned = torch.cos(angle) * gx - torch.sin(angle) * gy, torch.sin(angle) * gx + torch.cos(angle) * gy
    torch.testing.assert_close(layer(*turned), layer(gx, gy))
    assert (layer(gx, -gy) - layer(gx, gy)).abs().max() > 1e-2


def test_gradient_is_that_of_the_stencil_dense(surface, x):
    stencil = surface.stencil("gradients")
    dense = [
        torch.sparse_csr_tensor(stencil["indptr"], stencil["indices"], v, (162, 162), check_invariants=True).to_dense()
        for v in stencil["values"]
    ]
    torch.testing.assert_close(list(Gradient(surface)(x)), [matrix @ x for matrix in dense])


@pytest.mark.parametrize("part", ["diffusion", "gradient", "block"])
def test_gradients_in_float64(surface, x, part):
    block = DiffusionBlock(6, 0.0).double()
    block.diffusion.time.data.fill_(0.05)
    gradient = Gradient(surface)
    made = {
        "diffusion": lambda v: block.diffusion(v, surface.basis),
        "gradient": lambda v: torch.cat(gradient(v)),
        "block": lambda v: block(v, surface.basis, gradient),
    }[part]
    assert torch.autograd.gradcheck(made, (x.requires_grad_(),), fast_mode=True)


def test_every_parameter_learns(surface, x):
    made = net(descriptor_channels=4).train()
    made(x, surface).square().sum().backward()
    assert all(
        p.grad is not None and torch.isfinite(p.grad).all() and p.grad.abs().max() > 0 for p in made.parameters()
    )


def test_motion_changes_nothing_and_numbering_only_the_order(surface, x):
    mesh, made = blob(2), net()
    before = made.describe(x, surface)
    spun = mesh.vertices @ np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]) + 1.0
    moved = surface_of(replace(mesh, vertices=spun), 24, stencils_of("diffusionnet"))
    torch.testing.assert_close(made.describe(x, moved), before, atol=1e-5, rtol=1e-5)
    order = np.random.default_rng(0).permutation(162)
    renumbered = replace(mesh, vertices=mesh.vertices[order], faces=np.argsort(order)[mesh.faces])
    after = made.describe(x[order], surface_of(renumbered, 24, stencils_of("diffusionnet")))
    torch.testing.assert_close(after, before[order], atol=1e-5, rtol=1e-5)


def test_the_orientation_matters(surface, x):
    inside_out = surface_of(replace(blob(2), faces=blob(2).faces[:, ::-1]), 24, stencils_of("diffusionnet"))
    assert (net().describe(x, inside_out) - net().describe(x, surface)).abs().max() > 1e-3


def test_too_few_eigenpairs_are_named(surface, x):
    with pytest.raises(ValueError, match="wants 30 eigenpairs, the basis holds 24"):
        net(ks=30).describe(x, surface)
