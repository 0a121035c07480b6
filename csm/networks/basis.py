"""The truncated eigenbasis that the spectral layers compute in."""

from __future__ import annotations

from typing import NamedTuple

from torch import Tensor


class Basis(NamedTuple):
    """The first K Laplace-Beltrami eigenpairs of one shape, as tensors.

    Shapes: `evals` (K,) ascending, `evecs` (N, K) orthonormal with respect to `mass`, `mass` (N,) vertex areas.
    """

    evals: Tensor
    evecs: Tensor
    mass: Tensor

    @property
    def k(self) -> int:
        """Number of eigenpairs, K."""
        return self.evals.shape[0]

    def first(self, k: int) -> Basis:
        """Return the basis of the `k` lowest eigenpairs.

        Raises
        ------
        ValueError
            If the basis has fewer than `k` eigenpairs.
        """
        if k > self.k:
            raise ValueError(
                f"the network wants {k} eigenpairs, the basis holds {self.k}: prepare the data with data.basis_k={k}"
            )
        return Basis(self.evals[:k], self.evecs[:, :k], self.mass)

    def project(self, x: Tensor) -> Tensor:
        """Return the spectral coefficients Phi^T A x, shape (K, C), of the functions `x`, shape (N, C) (analysis)."""
        return self.evecs.T @ (self.mass[:, None] * x)

    def synthesize(self, coefficients: Tensor) -> Tensor:
        """Return the functions Phi c, shape (N, C), with the spectral coefficients c, shape (K, C) (synthesis)."""
        return self.evecs @ coefficients
