"""Functions on a surface and their energy in windows around points, for the windowed Fourier transforms."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Literal, TypeAlias

import numpy as np

from csm._types import FloatArray
from csm.descriptors.geovec import geometry_vectors
from csm.descriptors.hks import heat_kernel_signature, heat_times
from csm.descriptors.wks import WaveBand, wave_band, wave_kernel_signature
from csm.errors import ConfigError
from csm.mesh.shape import Mesh
from csm.operators.frames import edge_tensors, smooth
from csm.operators.operators import Operators
from csm.operators.spectrum import Spectrum

ColumnNorm: TypeAlias = Literal["vertices", "area"]

BANKS = {"geovec": 150, "hks": 100, "wks": 100}
"""Functions of which a number, counted from 1, picks one: "hks80" is the 80th of 100 times."""

SINGLE = ("constant", "fiedler", "shape_index")
"""Functions without a number: 1, the first eigenfunction that is not constant, and `shape_index`."""

_FLAT = 1e-9  # curvature tensors below this (radians, edge lengths relative to the mean) are rounding


def require_known(functions: Sequence[str]) -> None:
    """Raise ConfigError unless these are functions of `surface_functions`."""
    for name in functions:
        family, number = _parts(name)
        if name not in SINGLE and not 1 <= number <= BANKS.get(family, 0):
            banks = ", ".join(f"{family}1 to {family}{n}" for family, n in BANKS.items())
            raise ConfigError(f"there is no function {name!r} on a surface; there are {', '.join(SINGLE)}, {banks}")
    if not functions or len(set(functions)) < len(functions):
        raise ConfigError(f"functions are {functions}; wanted one or more, each once")


def surface_functions(
    operators: Operators, functions: Sequence[str], k: int, *, spline_shift: float, index_sweeps: int
) -> FloatArray:
    """Return functions on the surface by name, shape (N, P), from `k` pairs of the isotropic Laplacian.

    Parameters
    ----------
    operators
        Of the shape.
    functions
        P names out of `SINGLE`, and of `BANKS` with a number.
    k
        Number of eigenpairs.
    spline_shift
        `shift` of `csm.descriptors.geovec.geometry_vectors`, whose last knot is at lambda_K.
    index_sweeps
        `sweeps` of `shape_index`.
    """
    spectrum = operators.lbo(k)
    evals, evecs, zeros = spectrum.evals, spectrum.evecs, spectrum.n_zero()

    def column(name: str) -> FloatArray:
        family, number = _parts(name)
        pick = slice(number - 1, number)
        match family:
            case "constant":
                return np.ones(len(evecs))
            case "fiedler":
                return evecs[:, zeros]
            case "shape_index":
                return shape_index(operators.mesh, index_sweeps)
            case "hks":
                times = heat_times(evals[zeros], evals[-1], BANKS["hks"])[pick]
                return heat_kernel_signature(evals, evecs, times, scaled=False)[:, 0]
            case "wks":
                energies, sigma = wave_band(evals[zeros], evals[-1], BANKS["wks"], "aubry")
                return wave_kernel_signature(evals, evecs, WaveBand(energies[pick], sigma))[:, 0]
            case _:
                step = evals[-1] / (BANKS["geovec"] - 1)
                return geometry_vectors(evals, evecs, number, step, shift=spline_shift)[:, number - 1]

    return np.column_stack([column(name) for name in functions])


def shape_index(mesh: Mesh, sweeps: int) -> FloatArray:
    """Return -2/pi arctan((k1 + k2) / (k1 - k2)) for principal curvatures k1 >= k2, (N,), from -1 (cap) to 1 (cup).

    The curvatures are the two eigenvalues of greatest magnitude of the smoothed tensors of `csm.operators.frames`.
    Where they are equal the index is its limit, -1 or 1, and where the surface is flat it is 0.
    """
    values = np.linalg.eigvalsh(smooth(mesh, edge_tensors(mesh), sweeps))
    by_size = np.argsort(np.abs(values), axis=1, kind="stable")
    k2, k1 = np.sort(np.take_along_axis(values, by_size[:, 1:], axis=1), axis=1).T
    flat = np.abs(values).max(axis=1) <= _FLAT
    return np.where(flat, 0.0, -2 / np.pi * np.arctan2(k1 + k2, k1 - k2))


def windowed_energies(spectrum: Spectrum, functions: FloatArray, taus: Sequence[float]) -> FloatArray:
    r"""Return the energy of each function in the windows of each width around every vertex, shape (N, T, P).

    The window at x is T_x = sum_k e^{-tau A lambda_k} phi_k(x) phi_k, scaled to unit norm, with A the total area.
    With the transform S f(x, k) = A^{1/2} <f T_x, phi_k>, the energy is

    .. math:: D(x) = \sum_k \frac{\lambda_k^2}{\sum_m \lambda_m^2} \, S f(x, k)^2.

    No window is made: S f = A^{1/2} Phi diag(e^{-tau A lambda}) G / |T_x| with the K x K matrix
    G = Phi^T diag(a f) Phi, which costs N K^2 per function and width.

    Parameters
    ----------
    spectrum
        K eigenpairs.
    functions
        Shape (N, P).
    taus
        T widths, as fractions of the area.

    Raises
    ------
    NumericalError
        If all eigenvalues are zero.
    """
    evals, evecs, mass = spectrum.evals, spectrum.evecs, spectrum.mass
    area = mass.sum()
    decay = np.exp(-area * np.outer(taus, evals - evals[0]))
    squared_norms = decay**2 @ (evecs**2).T
    weights = (evals / evals[spectrum.n_zero() :].max()) ** 2
    weights /= weights.sum()
    energies = np.empty((len(evecs), len(decay), functions.shape[1]))
    for p, function in enumerate(functions.T):
        products = evecs.T @ ((mass * function)[:, None] * evecs)
        for t, window in enumerate(decay):
            transform = evecs @ (window[:, None] * products)
            energies[:, t, p] = area * (transform**2 @ weights) / squared_norms[t]
    return energies


def unit_columns(values: FloatArray, mass: FloatArray, norm: ColumnNorm) -> FloatArray:
    """Scale each column to length 1 (columns of zeros stay).

    ``"vertices"`` counts every vertex alike, so values shrink as a surface is sampled more finely; ``"area"`` weights
    them by `mass`, which makes the columns of different resolutions comparable.
    """
    weights = mass if norm == "area" else np.ones_like(mass)
    length = np.sqrt(weights @ values**2)
    return values / np.where(length > 0, length, 1.0)


def _parts(name: str) -> tuple[str, int]:
    """Return a name without the number at its end, and the number, or 0."""
    match = re.fullmatch(r"(\w*?)(\d*)", name)
    return (match[1], int(match[2] or 0)) if match else (name, 0)
