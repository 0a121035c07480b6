from __future__ import annotations

import pytest
import torch

from csm.networks.basis import Basis


@pytest.fixture
def basis() -> Basis:
    """Six functions on twenty vertices, orthonormal with respect to uneven masses."""
    torch.manual_seed(0)
    mass = torch.rand(20, dtype=torch.float64) + 0.1
    q, _ = torch.linalg.qr(torch.randn(20, 6, dtype=torch.float64))
    return Basis(torch.arange(6, dtype=torch.float64), q / mass.sqrt()[:, None], mass)


def test_analysis_undoes_synthesis(basis):
    coefficients = torch.randn(6, 3, dtype=torch.float64)
    torch.testing.assert_close(basis.project(basis.synthesize(coefficients)), coefficients)


def test_synthesis_of_the_analysis_is_the_closest_function_in_the_span(basis):
    x = torch.randn(20, 3, dtype=torch.float64)
    rest = x - basis.synthesize(basis.project(x))
    torch.testing.assert_close(basis.project(rest), torch.zeros(6, 3, dtype=torch.float64))


def test_first_keeps_the_lowest_pairs_and_refuses_more_than_there_are(basis):
    few = basis.first(4)
    assert few.k == 4
    torch.testing.assert_close(few.evecs, basis.evecs[:, :4])
    with pytest.raises(ValueError, match=r"wants 7 eigenpairs, the basis holds 6.*data\.basis_k=7"):
        basis.first(7)
