"""The spectral manifold wavelet descriptor (SMWD)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal, TypeAlias

from csm.descriptors.acd import unit_rows
from csm.descriptors.asmwd import meyer_block
from csm.descriptors.base import Descriptor, Features
from csm.operators.filters import filter_names, mexican_hat_filters
from csm.operators.operators import Operators

WaveletVariant: TypeAlias = Literal["meyer", "mexican"]


@dataclass(frozen=True)
class SMWD(Descriptor):
    r"""Spectral wavelets of an impulse, each read off at its own centre.

    .. math:: f_s(x) = \psi_{s,x}(x) = \sum_{k=1}^{K} g_s(\lambda_k) \, \phi_k(x)^2

    No code of this descriptor was found, and the paper that lists it says only that the transformed impulses are its
    components; every parameter below is therefore a guess.

    Parameters
    ----------
    variant
        Which filters; a guess.  ``"meyer"``: those of `csm.descriptors.asmwd.ASMWD`, divided by their sums, so that
        this is its isotropic case, which the same group ships beside it and uses elsewhere.  ``"mexican"``: those of
        `csm.operators.filters.mexican_hat_filters` as they are, the wavelets of the other spectral rival, WEDS.
    k
        K, number of eigenpairs, at least 2; a guess after the code of ASMWD.
    n_filters
        The low-pass function and the wavelets together, at least 2; a guess after the code of ASMWD.
    normalise
        Scale each row to unit length; a guess after the code of ASMWD.

    Raises
    ------
    ConfigError
        If a parameter is out of its range.

    Notes
    -----
    Blind to an intrinsic reflection, as every sum of g(lambda_k) phi_k^2 of the isotropic Laplacian.

    Examples
    --------
    >>> SMWD(n_filters=3).columns
    ('low-pass', 'wavelet 1', 'wavelet 2')
    """

    variant: WaveletVariant = "meyer"
    k: int = 100
    n_filters: int = 10
    normalise: bool = True

    name: ClassVar[str] = "smwd"

    def __post_init__(self) -> None:
        super().__post_init__()
        self.require_at_least(2, "k", "n_filters")

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns, from coarse to fine."""
        return filter_names(self.n_filters)

    def evaluate(self, operators: Operators) -> Features:
        """Return the descriptor of every vertex, (N, n_filters), in units of 1/area unless normalised."""
        spectrum = operators.lbo(self.k)
        if self.variant == "meyer":
            values = meyer_block(spectrum, self.n_filters)
        else:
            greatest = float(spectrum.evals[spectrum.n_zero() :].max())
            values = spectrum.evecs**2 @ mexican_hat_filters(spectrum.evals, self.n_filters, greatest)
        return Features(unit_rows(values) if self.normalise else values, self.columns)
