from __future__ import annotations

import pytest
import torch

from csm.networks import stencils_of
from csm.networks.mgcn import MGCN
from csm.networks.surface import Surface
from tests.shapes import blob
from tests.surfaces import surface_of

SMALL = {"ks": 40, "filters": 8}


@pytest.mark.parametrize(("width", "count"), [(128, 2_848_234), (48, 2_717_674), (140, 2_867_818), (240, 3_031_018)])
def test_parameter_counts(width, count):
    assert sum(p.numel() for p in MGCN(width, 6890).parameters()) == count


@pytest.fixture(scope="module")
def surface() -> Surface:
    return surface_of(blob(3), 2, stencils_of("mgcn", tolerance=0.01, **SMALL))


def small(**options) -> MGCN:
    torch.manual_seed(0)
    return MGCN(4, 30, (6, 6, 8), 12, **SMALL, **options).double()


@pytest.mark.parametrize("products", ["float32", "bfloat16"])
def test_it_runs_and_learns(surface, products):
    net, x = small(products=products), torch.randn(642, 4, dtype=torch.float64)
    assert net.describe(x, surface).shape == (642, 12)
    net(x, surface).square().sum().backward()
    assert all(p.grad is not None and torch.isfinite(p.grad).all() for p in net.parameters())


def test_relabelling_the_vertices_permutes_the_descriptor(surface):
    net, x = small(), torch.randn(642, 4, dtype=torch.float64)
    order = torch.randperm(642)
    places = torch.argsort(order)
    old = dict(surface.stencil("wavelets"))
    new = {**old, "evecs": old["evecs"][order], "rows": places[old["rows"]], "columns": places[old["columns"]]}
    moved = Surface(surface.basis, {"wavelets": new})
    torch.testing.assert_close(net.describe(x[order], moved), net.describe(x, surface)[order])


def test_size_of_the_input_features_does_not_matter(surface):
    net, x = small(), torch.randn(642, 4, dtype=torch.float64)
    scaled = x * torch.tensor([1.0, 30.0, 0.2, 5.0]) + 4
    torch.testing.assert_close(net.describe(scaled, surface), net.describe(x, surface))


def test_its_options_are_those_of_its_stencil():
    assert stencils_of("mgcn") == {"wavelets": {"k": 300, "n_filters": 32, "tolerance": 1e-3}}
    assert stencils_of("mgcn", ks=9, filters=6, tolerance=0.0, dropout=0.1)["wavelets"]["k"] == 9
    with pytest.raises(ValueError, match="bfloat16"):
        MGCN(3, 4, products="float16")  # type: ignore[arg-type]
