"""The truncated eigenbasis that spectral layers work in."""

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
            If fewer than `k` are there.
        """
        if k > self.k:
            raise ValueError(
                f"the network wants {k} eigenpairs, the basis holds {self.k}: prepare the data with data.basis_k={k}"
            )
        return Basis(self.evals[:k], self.evecs[:, :k], self.mass)

    def project(self, x: Tensor) -> Tensor:
        """Analysis: spectral coefficients Phi^T A x, shape (K, C), of the functions `x`, shape (N, C)."""
        return self.evecs.T @ (self.mass[:, None] * x)

    def synthesize(self, coefficients: Tensor) -> Tensor:
        """Synthesis: the functions Phi c, shape (N, C), with spectral coefficients `coefficients`, shape (K, C)."""
        return self.evecs @ coefficients
