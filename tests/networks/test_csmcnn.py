from __future__ import annotations

import pytest
import torch

from csm.networks import CSMCNN, Surface, build
from csm.networks.csmcnn import VertexNorm
from tests.networks.test_csmconv import basis_of
from tests.shapes import blob


def parameters(**options) -> int:
    net = CSMCNN(options.pop("p"), 6890, **options)
    return sum(p.numel() for p in net.parameters())


@pytest.mark.parametrize(
    ("options", "count"),
    [
        ({"p": 48, "terms": 6}, 1_906_602),
        ({"p": 48, "terms": 6, "normalisation": "none"}, 1_905_450),
        ({"p": 48, "terms": 5}, 1_890_218),
        ({"p": 140, "terms": 6}, 1_912_490),
        ({"p": 140, "terms": 6, "normalisation": "none"}, 1_911_338),
        ({"p": 140, "terms": 5}, 1_896_106),
        ({"p": 140, "terms": 5, "normalisation": "none"}, 1_894_954),
    ],
)
def test_parameter_counts(options, count):
    assert parameters(**options) == count


@pytest.fixture(scope="module")
def basis():
    mesh = blob(3)
    return basis_of(mesh, 24)


@pytest.mark.parametrize("normalisation", ["batch", "instance", "area", "none"])
@pytest.mark.parametrize("activation", ["relu", "elu", "leaky_relu", "gelu"])
def test_every_option_runs_and_learns(basis, normalisation, activation):
    torch.manual_seed(0)
    net = CSMCNN(4, 30, (8, 8, 16), 12, ks=20, terms=3, normalisation=normalisation, activation=activation).double()
    x = torch.randn(len(basis.mass), 4, dtype=torch.float64)
    assert net.describe(x, Surface(basis)).shape == (len(basis.mass), 12)
    net(x, Surface(basis)).square().sum().backward()
    assert all(p.grad is not None and torch.isfinite(p.grad).all() for p in net.parameters())


def test_relabelling_the_vertices_permutes_the_descriptor(basis):
    net = CSMCNN(4, 30, ks=20).double().eval()
    x = torch.randn(len(basis.mass), 4, dtype=torch.float64)
    order = torch.randperm(len(basis.mass))
    moved = basis._replace(evecs=basis.evecs[order], mass=basis.mass[order])
    torch.testing.assert_close(net.describe(x[order], Surface(moved)), net.describe(x, Surface(basis))[order])


def test_sign_flips_leave_the_network_unchanged(basis):
    net = CSMCNN(4, 30, ks=20).double().eval()
    x = torch.randn(len(basis.mass), 4, dtype=torch.float64)
    flipped = basis._replace(evecs=-basis.evecs)
    torch.testing.assert_close(net.describe(x, Surface(flipped)), net.describe(x, Surface(basis)))


@pytest.mark.parametrize("normalisation", ["instance", "area"])
def test_normalisation_gives_each_channel_mean_zero_and_variance_one(basis, normalisation):
    net = CSMCNN(4, 30, ks=20, normalisation=normalisation).double()
    y = net.finish[0][0](torch.randn(len(basis.mass), 64, dtype=torch.float64) * 5 + 3, basis.mass)
    share = (basis.mass if normalisation == "area" else torch.ones_like(basis.mass)) / 1.0
    share = share / share.sum()
    assert (share @ y).abs().max() < 1e-9
    torch.testing.assert_close(share @ y.square(), torch.ones(64, dtype=torch.float64), atol=1e-5, rtol=0)


def test_by_area_a_vertex_that_is_split_in_two_changes_nothing(basis):
    norm = VertexNorm(3, 1e-5, by_area=True).double()
    x = torch.randn(len(basis.mass), 3, dtype=torch.float64)
    halved = torch.cat([basis.mass[:1] / 2, basis.mass[1:], basis.mass[:1] / 2])
    torch.testing.assert_close(norm(torch.cat([x, x[:1]]), halved)[:-1], norm(x, basis.mass))


def test_unknown_names_are_answered_with_the_known_ones():
    with pytest.raises(ValueError, match=r"known are .*csmcnn"):
        build("gcn", 3, 4)
    with pytest.raises(ValueError, match="network csmcnn"):
        build("csmcnn", 3, 4, widht=3)
    with pytest.raises(ValueError, match="relu"):
        CSMCNN(3, 4, activation="sine")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="instance"):
        CSMCNN(3, 4, normalisation="layer")  # type: ignore[arg-type]


def test_filters_are_those_of_the_convolutions_at_the_eigenvalues_that_they_use(basis):
    net = CSMCNN(4, 30, (8, 6, 5), ks=20).double()
    filters = net.filters(basis.evals)
    assert {name: tuple(filter.shape) for name, filter in filters.items()} == {"conv1": (20, 8, 6), "conv2": (20, 6, 5)}
    torch.testing.assert_close(filters["conv2"], net.convs[1].filters(basis.evals[:20]))
