"""The Chebyshev spectral manifold convolution."""

from __future__ import annotations

import math
from typing import Literal

import torch
from torch import Tensor, nn

from csm.networks.basis import Basis

BiasDomain = Literal["spatial", "spectral"]


def chebyshev(x: Tensor, terms: int) -> Tensor:
    """Evaluate the Chebyshev polynomials of the first kind T_0 .. T_{terms-1}.

    Parameters
    ----------
    x
        Where the polynomials are evaluated, shape (K,), in [-1, 1].
    terms
        Number of polynomials, at least 1.

    Returns
    -------
    Tensor
        Shape (terms, K).
    """
    rows = [torch.ones_like(x), x]
    while len(rows) < terms:
        rows.append(2 * x * rows[-1] - rows[-2])
    return torch.stack(rows[:terms])


def reset_terms(weight: Tensor, bias: Tensor) -> None:
    """Draw a weight, shape (D, C_in, C_out), Xavier-uniformly with the fan of all D terms together; zero the bias."""
    terms, fan_in, fan_out = weight.shape
    bound = math.sqrt(6.0 / (terms * (fan_in + fan_out)))
    nn.init.uniform_(weight, -bound, bound)
    nn.init.zeros_(bias)


class CSMConv(nn.Module):
    r"""Chebyshev spectral manifold convolution (the paper's Eq. 11).

    .. math::
        y = \Phi \Big( \sum_{d=0}^{D-1} T_d(\tilde\Lambda)\,(\Phi^\top A\,x)\,W_d \Big) + b,
        \qquad \tilde\Lambda = 2 \Lambda / \lambda_K - I

    The bias is added in space.  The authors' released code adds it to the spectral coefficients instead, where it
    contributes :math:`b \sum_k \phi_k(x)`, which changes with the arbitrary sign of every eigenvector;
    ``bias="spectral"`` reproduces that.

    Parameters
    ----------
    in_channels, out_channels
        Channels C_in of the input and C_out of the output functions.
    terms
        Number D of Chebyshev polynomials, T_0 .. T_{D-1}.
    bias
        Where the bias is added: "spatial" (default) or "spectral".

    Shapes
    ------
    input (N, C_in), basis with K eigenpairs, output (N, C_out); weight (D, C_in, C_out), bias (C_out,).
    """

    def __init__(self, in_channels: int, out_channels: int, terms: int = 6, bias: BiasDomain = "spatial") -> None:
        super().__init__()
        if terms < 1:
            raise ValueError(f"CSMConv needs at least one Chebyshev term, got {terms}")
        if bias not in ("spatial", "spectral"):
            raise ValueError(f'bias must be "spatial" or "spectral", got {bias!r}')
        self.bias_domain: BiasDomain = bias
        self.weight = nn.Parameter(torch.empty(terms, in_channels, out_channels))
        self.bias = nn.Parameter(torch.zeros(out_channels))
        self.reset_parameters()

    def reset_parameters(self) -> None:
        """Draw the weights Xavier-uniformly with the fan of all terms together, and set the bias to zero."""
        reset_terms(self.weight, self.bias)

    def filters(self, evals: Tensor) -> Tensor:
        """Return the learned spectral filters sum_d T_d(2 evals / evals[-1] - 1) W_d, shape (K, C_in, C_out)."""
        polynomials = chebyshev(2 * evals / evals[-1] - 1, len(self.weight))
        return torch.einsum("dk,dio->kio", polynomials, self.weight)

    def forward(self, x: Tensor, basis: Basis) -> Tensor:
        """Return the functions `x`, shape (N, C_in), convolved on the shape with this basis, shape (N, C_out)."""
        polynomials = chebyshev(2 * basis.evals / basis.evals[-1] - 1, len(self.weight))
        coefficients = basis.project(x)
        terms = polynomials.T[:, :, None] * coefficients[:, None, :]
        y = terms.flatten(1) @ self.weight.flatten(0, 1)
        if self.bias_domain == "spectral":
            return basis.synthesize(y + self.bias)
        return basis.synthesize(y) + self.bias

    def extra_repr(self) -> str:
        """Show the sizes when the module is printed."""
        terms, fan_in, fan_out = self.weight.shape
        return f"{fan_in}, {fan_out}, terms={terms}, bias={self.bias_domain!r}"
