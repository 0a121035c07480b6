from __future__ import annotations

import pytest
import torch

from csm.networks import Basis, Surface, stencils_of
from csm.networks.surface import with_cuts


@pytest.fixture
def surface() -> Surface:
    basis = Basis(torch.tensor([0.0, 1.0]), torch.eye(5)[:, :2], torch.ones(5))
    return Surface(basis, {"edges": {"ends": torch.zeros(2, 7, dtype=torch.int64)}})


def test_a_stencil_that_is_not_there_is_named(surface):
    assert surface.stencil("edges")["ends"].shape == (2, 7)
    with pytest.raises(ValueError, match="wants the stencil 'gradients'"):
        surface.stencil("gradients")


def test_moving_keeps_everything(surface):
    moved = surface.to("meta")
    assert moved.n_vertices == surface.n_vertices == 5
    assert moved.basis.evecs.device.type == moved.stencil("edges")["ends"].device.type == "meta"


def test_what_is_read_on_the_host_stays_there(surface):
    stencils = {
        "wavelets": {"responses": torch.tensor([[1.0, 2.0], [0.0, 3.0]]), "extents": torch.ones(2, 2)},
        "edge_splines": {"indptr": torch.tensor([0, 2, 3, 7]), "offsets": torch.tensor([0, 1, 3])},
    }
    moved = Surface(surface.basis, with_cuts(stencils)).to("meta")
    wavelets, splines = moved.stencil("wavelets"), moved.stencil("edge_splines")
    assert wavelets["used"].tolist() == [1, 2]
    assert splines["starts"].tolist() == [0, 2, 7]
    assert wavelets["extents"].device.type == splines["offsets"].device.type == "cpu"
    assert wavelets["responses"].device.type == splines["indptr"].device.type == "meta"


def test_unknown_networks_are_named():
    with pytest.raises(ValueError, match=r"no network 'nope'; known are .*csmcnn"):
        stencils_of("nope")
