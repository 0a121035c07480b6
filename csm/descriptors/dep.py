"""The discrete time evolution process descriptor (DEP)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations_with_replacement
from typing import ClassVar, Literal, NamedTuple, TypeAlias

import numpy as np

from csm._types import Float32Array, FloatArray
from csm.descriptors.base import Descriptor, Features
from csm.operators.geodesic import geodesics
from csm.operators.operators import Operators

EvolutionDistance: TypeAlias = Literal["edge", "heat", "biharmonic"]

_BLOCK = 512
"""Rows or columns of the N x N matrix that are worked on at once; only the matrix itself is ever held whole."""


@dataclass(frozen=True)
class DEP(Descriptor):
    r"""Sum of the discounted steps in which a constant function evolves within a distance delta of every point.

    With distances d scaled to a greatest of 1, vertex areas Omega and the process  E = K Omega  of

    .. math:: K_{ij} = 1 - d_{ij} \text{ if } d_{ij} \le \delta \text{ else } 0, \qquad
        g_\delta = \sum_{m \ge 0} \Bigl(\frac{c}{\rho(E)} E\Bigr)^m 1 = \Bigl(I - \frac{c}{\rho(E)} E\Bigr)^{-1} 1,

    where rho is the spectral radius, a column is g scaled to the range 0 to 1.

    Parameters
    ----------
    n_scales, smallest, largest
        Number of columns, and the first and last of their evenly spaced delta.  A guess: the source's list was not to
        be had; code by some of its authors uses the two scales 0.04 and 1 (``n_scales=2``).
    c
        Discount of one step, between 0 and 1.  A guess for the same reason; 0.1 is that of the same code.
    distance
        A guess: the source speaks of geodesic distances and does not say which.  ``"edge"``: shortest paths along
        edges.  ``"heat"``: the heat method.  ``"biharmonic"``: the distance between the points
        (phi_k / lambda_k) of the first K eigenpairs that are not constant, as the same code has it.
    k
        K, eigenpairs of the biharmonic distance, which alone uses them.  A guess.
    tolerance
        The series ends where the rest is below this fraction of its first step, in the norm of L2.

    Raises
    ------
    ConfigError
        If `n_scales`, `k`, `smallest`, `largest`, `c` or `tolerance` is out of its range, or `distance` is unknown.

    Notes
    -----
    Holds one N x N matrix in single precision (0.9 GB at 15,000 vertices), and no other.  No system is solved: the
    spectrum of (c / rho) E lies within -c and c, so each further term of the series is worth a factor c.  Distances are
    kept to seven digits, so a pair that is delta apart to that precision may fall on either side.  Parts that no path
    joins are infinitely far apart, except for the biharmonic distance.

    Paths through the midpoints of edges as well are four times as even (over exact distances, a spread of 0.3 % against
    1.3 %) at twice the time, and match no better: errors of 163 and 164 thousandths of the diameter on four pairs of
    remeshed FAUST, and 162 by heat.  So they are left out.

    References
    ----------
    Melzi, Ovsjanikov, Roffo, Cristani, Castellani, "Discrete time evolution process descriptor for shape analysis and
    matching", ACM TOG 37, 2018.
    """

    n_scales: int = 15
    smallest: float = 0.04
    largest: float = 1.0
    c: float = 0.1
    distance: EvolutionDistance = "edge"
    k: int = 100
    tolerance: float = 1e-6

    name: ClassVar[str] = "dep"

    def __post_init__(self) -> None:
        super().__post_init__()
        self.require_at_least(1, "n_scales")
        self.require_at_least(2, "k")
        self.require(0 < self.largest <= 1, "largest", "a number above 0, up to 1")
        self.require(0 < self.smallest <= self.largest, "smallest", f"a number above 0, up to largest={self.largest:g}")
        for name in ("c", "tolerance"):
            self.require(0 < getattr(self, name) < 1, name, "a number between 0 and 1, both left out")

    @property
    def scales(self) -> FloatArray:
        """The distances delta, ascending, shape (n_scales,)."""
        return np.linspace(self.smallest, self.largest, self.n_scales)

    @property
    def terms(self) -> int:
        """Number of steps after which the rest of the series is below `tolerance`."""
        return max(1, int(np.ceil(np.log(self.tolerance * (1 - self.c)) / np.log(self.c))))

    @property
    def eigenpairs(self) -> int:
        """K for the biharmonic distance; the others use no eigenpairs."""
        return self.k if self.distance == "biharmonic" else 0

    def evaluate(self, operators: Operators) -> Features:
        """Return the descriptor of every vertex, (N, n_scales), without unit."""
        kernel = closeness(self._rows(operators), operators.mesh.n_vertices)
        columns = []
        for delta in self.scales[::-1]:  # descending: entries once set to zero stay zero, so one matrix is enough
            cut_beyond(kernel, delta)
            columns.append(unit_range(evolution(kernel, operators.mass, self.c, self.terms)))
        return Features(np.stack(columns[::-1], axis=1), tuple(f"delta={delta:.3f}" for delta in self.scales))

    def _rows(self, operators: Operators) -> Iterator[FloatArray]:
        """Yield the rows of the distance matrix, some at a time."""
        n = operators.mesh.n_vertices
        blocks = (np.arange(n)[here] for here in _blocks(n))
        if self.distance == "biharmonic":
            spectrum = operators.lbo(self.k)
            zeros = spectrum.n_zero()
            points = spectrum.evecs[:, zeros:] / spectrum.evals[zeros:]
            squares = np.einsum("nk,nk->n", points, points)
            for block in blocks:
                squared = squares[block, None] + squares - 2 * points[block] @ points.T
                yield np.sqrt(np.maximum(squared, 0))
        else:
            measure = geodesics(operators.mesh, self.distance)
            for block in blocks:
                yield measure.rows(block)


def closeness(rows: Iterator[FloatArray], n: int) -> Float32Array:
    """Return 1 - d for distances d scaled to a greatest of 1, (N, N), and 0 where they are infinite.

    `rows` gives the distance matrix from the top; what is not symmetric about it is averaged out.
    """
    kernel = np.empty((n, n), dtype=np.float32)
    top = 0
    for block in rows:
        kernel[top : top + len(block)] = block
        top += len(block)
    greatest = 0.0
    for here, there in combinations_with_replacement(_blocks(n), 2):
        mean = (kernel[here, there] + kernel[there, here].T) / 2
        kernel[here, there], kernel[there, here] = mean, mean.T
        greatest = max(greatest, float(np.max(mean, initial=0.0, where=np.isfinite(mean))))
    for here in _blocks(n):
        kernel[here] = np.maximum(1 - kernel[here] / np.float32(greatest), 0)
    return kernel


def cut_beyond(kernel: Float32Array, delta: float) -> None:
    """Set the entries of 1 - d to zero, in place, where d > `delta`."""
    for here in _blocks(len(kernel)):
        block = kernel[here]
        block[block < np.float32(1 - delta)] = 0


def evolution(kernel: Float32Array, mass: FloatArray, c: float, terms: int) -> FloatArray:
    """Return (g - 1) / c, shape (N,), by `terms` steps of the series for  (1 - (c / rho) E) g = 1  with E = K Omega."""
    space = powers_of_one(kernel, mass, terms)
    step = space.process / space.radius
    wave, gathered = space.one, np.zeros(len(space.one))
    for m in range(terms):
        wave = step @ wave
        gathered += c**m * wave
    return space.basis @ gathered


class Krylov(NamedTuple):
    """What  E = K Omega  makes of 1 again and again.

    `basis` (N, S) spans 1, E 1, E^2 1, ... and is orthonormal with respect to Omega, `process` (S, S) is E and `one`
    (S,) is 1 in it, and `radius` the spectral radius of E.
    """

    basis: FloatArray
    process: FloatArray
    one: FloatArray
    radius: float


def powers_of_one(kernel: Float32Array, mass: FloatArray, least: int) -> Krylov:
    """Take Lanczos steps: more than `least`, until the space all but holds an eigenfunction of the spectral radius.

    It ends before where there is nothing beyond it.
    """
    total = float(np.sqrt(mass.sum()))
    basis, process = np.full((len(mass), 1), 1 / total), np.zeros((0, 0))
    while True:
        image = _times(kernel, mass * basis[:, -1])
        column = basis.T @ (mass * image)
        image -= basis @ column
        image -= basis @ (basis.T @ (mass * image))  # zero but for rounding
        process = np.block([[process, column[:-1, None]], [column[None]]])
        beyond = float(np.sqrt(mass @ image**2))
        evals, evecs = np.linalg.eigh(process)
        # The error of an eigenvalue goes with the square of what its eigenfunction lacks.
        found = len(column) > least and beyond * abs(evecs[-1, -1]) <= 1e-4 * evals[-1]
        if found or beyond <= 1e-6 * evals[-1]:  # of single precision
            return Krylov(basis, process, total * np.eye(len(column))[0], float(evals[-1]))
        basis = np.column_stack([basis, image / beyond])


def unit_range(values: FloatArray) -> FloatArray:
    """Shift and scale to the range 0 to 1; values that are all the same become 0."""
    above: FloatArray = values - values.min()
    greatest = float(above.max())
    return above / (greatest if greatest > 0 else 1.0)


def _blocks(n: int) -> list[slice]:
    return [slice(start, start + _BLOCK) for start in range(0, n, _BLOCK)]


def _times(kernel: Float32Array, x: FloatArray) -> FloatArray:
    """Return the product with a vector, summed in double precision between blocks of columns."""
    single = x.astype(np.float32)
    total = np.zeros(len(kernel))
    for there in _blocks(len(x)):
        total += kernel[:, there] @ single[there]
    return total
