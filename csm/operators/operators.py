"""The operators of one mesh, computed when first asked for and kept."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, Protocol

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from csm._counts import counted
from csm._types import Arrays, FloatArray, IntArray
from csm.errors import NumericalError
from csm.mesh.check import require_usable
from csm.mesh.debris import Body, body_of, component_areas
from csm.mesh.debris import unit_area as with_unit_area
from csm.mesh.inputs import MeshLike, as_mesh
from csm.mesh.shape import Mesh
from csm.operators._factors import Factors
from csm.operators.coarsening import Coarse, coarsen
from csm.operators.frames import FrameKind, face_frames
from csm.operators.laplacian import (
    AnisotropicStiffness,
    anisotropic_stiffness,
    degenerate_faces,
    stiffness,
    vertex_areas,
)
from csm.operators.multilevel import most_pairs, multilevel_eigenpairs
from csm.operators.spectrum import Spectrum, eigenpairs

_log = logging.getLogger(__name__)

DIRECT_UP_TO = 200_000
"""Vertices of the largest mesh whose matrices are factored; for larger ones the multilevel way is quicker."""


class Memo(Protocol):
    """Where results are looked up and kept, such as `csm.data.store.Store`."""

    def fetch(self, kind: str, mesh: Mesh, params: Mapping[str, Any], make: Callable[[], Arrays]) -> Arrays:
        """Return the stored arrays of this kind, geometry and parameters; compute and store them if there are none."""
        ...


@dataclass(frozen=True, eq=False)
class OperatorsOfBody:
    """The operators of what is left of a mesh without its debris.

    Attributes
    ----------
    operators
        Of the body, a mesh of B vertices.
    vertices
        Shape (B,): the vertices of the whole mesh that the body has.
    nearest
        Shape (N,): for each vertex of the whole mesh the body's vertex nearest to it in space, itself if it is one.
    """

    operators: Operators
    vertices: IntArray
    nearest: IntArray

    def spread(self, spectrum: Spectrum, mass: FloatArray, note: str) -> Spectrum:
        """Return a spectrum of the body as one of the whole mesh, of vertex areas `mass`: zero on debris."""
        evecs = np.zeros((len(mass), len(spectrum.evals)))
        evecs[self.vertices] = spectrum.evecs
        return replace(spectrum, evecs=evecs, mass=mass, notes=(*spectrum.notes, note))


class Operators:
    """Laplacians and spectra of one mesh, computed when first asked for and kept.

    When fewer eigenpairs of a Laplacian are asked for than were computed before, they are taken from those.

    Debris (`csm.mesh.debris`: components of less than 1 % of the area, and vertices in no face) takes no part: areas
    and eigenfunctions are those of the body, and zero on debris, which a note of each spectrum says.

    Parameters
    ----------
    mesh
        The shape, in any way that `csm.mesh.inputs.as_mesh` takes.
    unit_area
        Scale it to a surface area of 1 first, as every default in csm assumes; `self.mesh.scale` keeps the way back.
    memo
        Where spectra are looked up, and kept longer than this object, such as a `csm.data.store.Store`.

    Raises
    ------
    MeshError
        If the mesh cannot carry a Laplacian.

    Attributes
    ----------
    mesh
        The (rescaled) mesh that every result refers to; without debris it has an area of 1.
    body
        The operators of the mesh without its debris; None if there is none.
    n_components
        Number of components that are no debris.
    """

    def __init__(self, mesh: MeshLike, *, unit_area: bool = True, memo: Memo | None = None) -> None:
        mesh = as_mesh(mesh)
        require_usable(mesh)
        found = body_of(mesh)
        self.mesh = with_unit_area(mesh) if unit_area else mesh
        self._debris = found.note
        self.n_components = found.n_components
        self.body = None if found.is_all else _body(self.mesh, found, memo)
        self._memo = memo
        self._of_thread = threading.local()
        self._said_flat = False
        self._areas: FloatArray | None = None
        self._anisotropic: dict[tuple[FrameKind, int, float], AnisotropicStiffness] = {}
        self._spectra: dict[tuple[str, tuple[tuple[str, Any], ...]], Spectrum] = {}

    def __repr__(self) -> str:
        return f"Operators({self.mesh!r})"

    def parts(self) -> Iterator[OperatorsOfBody]:
        """Yield the operators of each component of the body by itself, at the scale of the whole."""
        label = component_areas(self.mesh)[0]
        for number in np.unique(label[self.mesh.faces[:, 0]]):
            inside = label == number
            vertices = np.flatnonzero(inside)
            faces = (np.cumsum(inside) - 1)[self.mesh.faces[inside[self.mesh.faces[:, 0]]]]
            part = replace(self.mesh, vertices=self.mesh.vertices[vertices], faces=faces)
            yield OperatorsOfBody(Operators(part, unit_area=False, memo=self._memo), vertices, np.zeros(0, np.int64))

    @property
    def mass(self) -> FloatArray:
        """Vertex areas, shape (N,); zero on debris."""
        if self._areas is None:
            self._areas = vertex_areas(self.mesh)
            if self.body is not None:
                self._areas = np.zeros(self.mesh.n_vertices)
                self._areas[self.body.vertices] = self.body.operators.mass
        return self._areas

    def share(self) -> None:
        """Make what all spectra share, so that of several threads that ask for them no two make it."""
        _ = self.mass
        if self.body is not None:
            self.body.operators.share()
        elif self.mesh.n_vertices > DIRECT_UP_TO:
            _ = self.coarse

    def anisotropic(
        self, *, frame: FrameKind = "line_field", sweeps: int = 3, smoothing: float = 0.08
    ) -> AnisotropicStiffness:
        """Return the stiffness of every strength and angle for one choice of frames."""
        key = (frame, sweeps, smoothing)
        if key not in self._anisotropic:
            frames = face_frames(self.mesh, frame=frame, sweeps=sweeps, smoothing=smoothing)
            self._anisotropic[key] = anisotropic_stiffness(self.mesh, frames)
        return self._anisotropic[key]

    def lbo(self, k: int) -> Spectrum:
        """Return the `k` smallest eigenpairs of the isotropic Laplacian."""
        if self.body is not None:
            return self.body.spread(self.body.operators.lbo(k), self.mass, self._debris)
        return self._spectrum("lbo", {"k": int(k)}, lambda: self._solve(stiffness(self.mesh), k))

    def albo(
        self,
        alpha: float,
        theta: float,
        k: int,
        *,
        frame: FrameKind = "line_field",
        sweeps: int = 3,
        smoothing: float = 0.08,
    ) -> Spectrum:
        """Return the `k` smallest eigenpairs of the anisotropic Laplacian of strength `alpha` and angle `theta`.

        `frame`, `sweeps` and `smoothing` are those of `csm.operators.frames.face_frames`; `theta` is in radians, of
        period pi.
        """
        if self.body is not None:
            inner = self.body.operators.albo(alpha, theta, k, frame=frame, sweeps=sweeps, smoothing=smoothing)
            return self.body.spread(inner, self.mass, self._debris)
        params = {
            "alpha": float(alpha),
            "theta": float(theta),
            "k": int(k),
            "frame": str(frame),
            "sweeps": int(sweeps),
            "smoothing": float(smoothing),
        }

        def solve() -> Spectrum:
            matrix = self.anisotropic(frame=frame, sweeps=sweeps, smoothing=smoothing).at(alpha, theta)
            return self._solve(matrix, k, density=np.sqrt(1.0 + alpha))

        return self._spectrum("albo", params, solve)

    def _solve(self, matrix: sparse.csr_array, k: int, density: float = 1.0) -> Spectrum:
        spectrum = self._multilevel(matrix, k, density) or eigenpairs(
            matrix, self.mass, k, name=self.mesh.label, density=density, factors=self._factors(matrix)
        )
        flat = self._flat
        if flat.size == 0:
            return spectrum
        note = (
            f"{counted(flat.size, 'face has', 'faces have')} (almost) no area, the first is face {flat[0]}; the "
            "Laplacian floors their area"
        )
        if not self._said_flat:
            _log.warning("%s: %s", self.mesh.label, note)
            self._said_flat = True
        return replace(spectrum, notes=(*spectrum.notes, note))

    def _multilevel(self, matrix: sparse.csr_array, k: int, density: float) -> Spectrum | None:
        """Return the eigenpairs of a big mesh; None if it is not big, or if this way does not suit it."""
        if self.mesh.n_vertices <= DIRECT_UP_TO or k > most_pairs(self.coarse):
            return None
        try:
            return multilevel_eigenpairs(matrix, self.mass, k, self.coarse, name=self.mesh.label, density=density)
        except NumericalError as error:
            _log.warning("%s; they are computed from a factorisation, which takes time and memory", error)
            return None

    @cached_property
    def coarse(self) -> Coarse:
        """A coarse mesh, from which the eigenpairs of one of more than `DIRECT_UP_TO` vertices are refined."""
        return coarsen(self.mesh)

    @cached_property
    def _flat(self) -> IntArray:
        return degenerate_faces(self.mesh)

    def _factors(self, matrix: sparse.csr_array) -> Factors:
        """Return this thread's factors: all Laplacians of a mesh have one pattern."""
        if not hasattr(self._of_thread, "factors"):
            self._of_thread.factors = Factors(matrix)
        found: Factors = self._of_thread.factors
        return found

    def _spectrum(self, kind: str, params: dict[str, Any], solve: Callable[[], Spectrum]) -> Spectrum:
        key = (kind, tuple(params.items()))
        if key not in self._spectra:
            larger = self._larger(kind, params)
            make = solve if larger is None else partial(larger.first, params["k"])
            if self._memo is None:
                self._spectra[key] = make()
            else:
                arrays = self._memo.fetch(kind, self.mesh, params, lambda: _to_arrays(make()))
                self._spectra[key] = _from_arrays(arrays)
            self._spectra[key] = replace(self._spectra[key], name=self.mesh.label)
        return self._spectra[key]

    def _larger(self, kind: str, params: dict[str, Any]) -> Spectrum | None:
        """Return a spectrum of the same Laplacian with more eigenpairs that was computed before, if there is one."""
        for (other, items), spectrum in list(self._spectra.items()):  # another thread may add to it
            if other == kind and len(spectrum.evals) > params["k"] and {**dict(items), "k": params["k"]} == params:
                return spectrum
        return None


def _body(mesh: Mesh, found: Body, memo: Memo | None) -> OperatorsOfBody:
    vertices = np.flatnonzero(found.vertices)
    number = np.cumsum(found.vertices) - 1
    body = replace(mesh, vertices=mesh.vertices[vertices], faces=number[mesh.faces[found.faces]])
    nearest = number.copy()
    out = np.flatnonzero(~found.vertices)
    places = np.nan_to_num(mesh.vertices[out])
    nearest[out] = cKDTree(body.vertices).query(places)[1]
    return OperatorsOfBody(Operators(body, unit_area=False, memo=memo), vertices, nearest)


def _to_arrays(spectrum: Spectrum) -> Arrays:
    return {
        "evals": spectrum.evals,
        "evecs": spectrum.evecs,
        "mass": spectrum.mass,
        "residual": np.array(spectrum.residual),
        "notes": np.array(spectrum.notes, dtype=np.str_),
    }


def _from_arrays(arrays: Arrays) -> Spectrum:
    return Spectrum(
        evals=arrays["evals"],
        evecs=arrays["evecs"],
        mass=arrays["mass"],
        residual=float(arrays["residual"]),
        notes=tuple(str(note) for note in arrays["notes"]),
    )
