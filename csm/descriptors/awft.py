"""Anisotropic windowed Fourier transform signatures (AWFT)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from csm.descriptors.base import Descriptor, Features
from csm.descriptors.windowed import ColumnNorm, require_known, surface_functions, unit_columns, windowed_energies
from csm.operators.frames import FrameKind
from csm.operators.operators import Operators
from csm.operators.spectrum import Spectrum


class _Laplacian(NamedTuple):
    alpha: float  # 0 is isotropic
    degrees: float


@dataclass(frozen=True)
class AWFT(Descriptor):
    """Energy of functions on the surface in anisotropic heat windows around every point.

    The energy is `csm.descriptors.windowed.windowed_energies`, with the isotropic Laplacian and with the anisotropic
    ones of every angle and strength in turn; the functions are those of the isotropic one.

    Parameters
    ----------
    alphas
        Strengths, positive.
    degrees
        Angles in degrees, of period 180.
    k
        K, eigenpairs per Laplacian, at least 2.
    taus
        Widths of the windows, as fractions of the area.
    functions
        Names of functions, as `csm.descriptors.windowed.surface_functions` takes them.
    duplicates
        Repeat the isotropic columns for every strength, as published; they then weigh more in a distance.
    normalise
        Scale each column to length 1 over ``"vertices"``, as published, or over the ``"area"``, which alone is
        comparable between resolutions.
    spline_shift
        Where the geometry vectors' splines lie, see `csm.descriptors.geovec.spline_weights`.  A guess: their helper
        was not published, and 0 is what the inventors of geometry vectors use.
    index_sweeps
        Smoothing sweeps of the shape index.
    frame, sweeps, smoothing
        Of `csm.operators.frames.face_frames` (the published code has frames of its own kind and 10 sweeps).

    Raises
    ------
    ConfigError
        If a parameter is out of its range.

    Notes
    -----
    A mirror image exchanges the columns of an angle with those of 180 degrees less that angle; of the published
    angles only 45 and 135 tell left from right.

    References
    ----------
    Melzi, Rodola, Castellani, Bronstein, "Shape analysis with anisotropic windowed Fourier transform", 3DV 2016, and
    its published code.

    Examples
    --------
    >>> len(AWFT().columns), len(AWFT(duplicates=False).columns)
    (100, 90)
    >>> AWFT().columns[5], AWFT().columns[10]
    ('tau=0.002 isotropic (alpha=300) geovec3', 'tau=0.002 45deg alpha=100 geovec3')
    """

    alphas: tuple[float, ...] = (100.0, 300.0)
    degrees: tuple[float, ...] = (45.0, 90.0, 135.0, 180.0)
    k: int = 200
    taus: tuple[float, ...] = (0.002, 0.05)
    functions: tuple[str, ...] = ("geovec3", "geovec4", "shape_index", "fiedler", "constant")
    duplicates: bool = True
    normalise: ColumnNorm = "vertices"
    spline_shift: float = 0.0
    index_sweeps: int = 10
    frame: FrameKind = "line_field"
    sweeps: int = 3
    smoothing: float = 0.08

    name: ClassVar[str] = "awft"

    def __post_init__(self) -> None:
        super().__post_init__()
        for field in ("alphas", "degrees", "taus", "functions"):  # lists, as json and configuration files have them
            object.__setattr__(self, field, tuple(getattr(self, field)))
        require_known(self.functions)
        self.require_at_least(0, "index_sweeps")
        self.require_at_least(2, "k")
        self.require(bool(self.degrees), "degrees", "one angle or more")
        self.require_positive("alphas", "taus")

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns: by width, then Laplacian (isotropic, then by angle and strength), then function."""
        isotropic = [f"isotropic (alpha={alpha:g})" for alpha in self.alphas] if self.duplicates else ["isotropic"]
        laplacians = [*isotropic, *(f"{a:g}deg alpha={alpha:g}" for a in self.degrees for alpha in self.alphas)]
        return tuple(f"tau={tau:g} {name} {f}" for tau in self.taus for name in laplacians for f in self.functions)

    def evaluate(self, operators: Operators) -> Features:
        """Return the descriptor of every vertex: for each width and Laplacian one column per function."""
        functions = surface_functions(
            operators, self.functions, self.k, spline_shift=self.spline_shift, index_sweeps=self.index_sweeps
        )
        energies = {
            which: windowed_energies(self._spectrum(operators, which), functions, self.taus)
            for which in dict.fromkeys(self._laplacians())
        }
        values = np.stack([energies[which] for which in self._laplacians()], axis=2)
        return Features(unit_columns(values.reshape(len(values), -1), operators.mass, self.normalise), self.columns)

    def _laplacians(self) -> list[_Laplacian]:
        """Return the Laplacian of every block of columns; equal ones are equal here."""
        isotropic = [_Laplacian(0.0, 0.0)] * (len(self.alphas) if self.duplicates else 1)
        return [*isotropic, *(_Laplacian(alpha, a % 180.0) for a in self.degrees for alpha in self.alphas)]

    def _spectrum(self, operators: Operators, which: _Laplacian) -> Spectrum:
        if which.alpha == 0:
            return operators.lbo(self.k)
        theta = float(np.radians(which.degrees))
        return operators.albo(
            which.alpha, theta, self.k, frame=self.frame, sweeps=self.sweeps, smoothing=self.smoothing
        )
