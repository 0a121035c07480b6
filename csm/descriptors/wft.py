"""Windowed Fourier transform signatures (WFT)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from csm.descriptors.base import Descriptor, Features
from csm.descriptors.windowed import ColumnNorm, require_known, surface_functions, unit_columns, windowed_energies
from csm.operators.operators import Operators


@dataclass(frozen=True)
class WFT(Descriptor):
    """Energy of functions on the surface in heat windows around every point; one column per width and function.

    The energy is `csm.descriptors.windowed.windowed_energies` with the isotropic Laplacian.  That the paper's WFT is
    this descriptor, and not a learned one of the same authors, is itself a guess: it is the half of the published code
    of AWFT that needs no learning.

    Parameters
    ----------
    k
        K, number of eigenpairs, at least 2.
    taus
        Widths of the windows, as fractions of the area.
    functions
        Names of functions, as `csm.descriptors.windowed.surface_functions` takes them.  The heat and wave signatures
        (of these K eigenpairs; unscaled, and of Aubry's variant) are read as ascending in time and energy and counted
        from 1, which is a guess: the code numbers them without saying how.
    normalise
        Scale each column to length 1 over ``"vertices"``, as published, or over the ``"area"``, which alone is
        comparable between resolutions.
    spline_shift
        Where the geometry vectors' splines lie, see `csm.descriptors.geovec.spline_weights`.  A guess: their helper
        was not published, and 0 is what the inventors of geometry vectors use.
    index_sweeps
        Smoothing sweeps of the shape index.

    Raises
    ------
    ConfigError
        If a parameter is out of its range.

    Notes
    -----
    Blind to an intrinsic reflection.

    References
    ----------
    Boscaini et al., "Learning class-specific descriptors for deformable shapes using localized spectral convolutional
    networks", CGF (SGP) 2015; settings of the published code of Melzi, Rodola, Castellani, Bronstein, "Shape analysis
    with anisotropic windowed Fourier transform", 3DV 2016.

    Examples
    --------
    >>> len(WFT().columns), WFT().columns[0]
    (50, 'tau=0.001 geovec1')
    """

    k: int = 200
    taus: tuple[float, ...] = (0.001, 0.005, 0.01, 0.05, 0.1)
    functions: tuple[str, ...] = (
        "geovec1",
        "geovec3",
        "geovec4",
        "geovec5",
        "geovec6",
        "constant",
        "fiedler",
        "shape_index",
        "hks80",
        "wks80",
    )
    normalise: ColumnNorm = "vertices"
    spline_shift: float = 0.0
    index_sweeps: int = 10

    name: ClassVar[str] = "wft"

    def __post_init__(self) -> None:
        super().__post_init__()
        for field in ("taus", "functions"):  # lists, as json and configuration files have them
            object.__setattr__(self, field, tuple(getattr(self, field)))
        require_known(self.functions)
        self.require_at_least(0, "index_sweeps")
        self.require_at_least(2, "k")
        self.require_positive("taus")

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns, width by width."""
        return tuple(f"tau={tau:g} {function}" for tau in self.taus for function in self.functions)

    def evaluate(self, operators: Operators) -> Features:
        """Return the descriptor of every vertex, (N, T P) for T widths and P functions."""
        functions = surface_functions(
            operators, self.functions, self.k, spline_shift=self.spline_shift, index_sweeps=self.index_sweeps
        )
        energies = windowed_energies(operators.lbo(self.k), functions, self.taus)
        values = energies.reshape(len(energies), -1)
        return Features(unit_columns(values, operators.mass, self.normalise), self.columns)
