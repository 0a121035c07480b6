"""Descriptors with one block of columns per angle of the anisotropic Laplacian."""

from __future__ import annotations

from multiprocessing import parent_process

import numpy as np

from csm._parallel import thread_map
from csm._progress import progress_bar
from csm._types import FloatArray
from csm.descriptors.base import Descriptor
from csm.operators.frames import FrameKind
from csm.operators.operators import Operators
from csm.operators.spectrum import Spectrum

_SLOW = 100_000  # vertices; the angles of larger meshes take half a minute and more


class ByAngle(Descriptor):
    """A descriptor with one block of columns per angle; the parameters below are fields of each family."""

    alpha: float
    angles: int
    k: int
    frame: FrameKind
    sweeps: int
    smoothing: float

    @property
    def thetas(self) -> FloatArray:
        """The angles in radians, shape (J,)."""
        return np.arange(self.angles, dtype=np.float64) * (np.pi / self.angles)

    def _require_different_angles(self) -> None:
        alike = self.alpha == 0 and self.angles != 1
        self.require(not alike, "angles", "1 at alpha=0, where all blocks would be equal; set angles=1")

    def _spectra(self, operators: Operators, k: int | None = None) -> list[Spectrum]:
        """Return the `k` smallest eigenpairs for each angle, by several threads, with a bar for big meshes."""
        operators.share()
        if self.alpha > 0:
            operators.anisotropic(frame=self.frame, sweeps=self.sweeps, smoothing=self.smoothing)
        mesh, alone = operators.mesh, parent_process() is None  # a process of a parallel map has a bar for all shapes
        with progress_bar(
            total=self.angles, desc=mesh.label, unit="angle", disable=not (alone and mesh.n_vertices > _SLOW)
        ) as bar:

            def spectrum(theta: float) -> Spectrum:
                found = self._spectrum(operators, theta, k)
                bar.update()
                return found

            return thread_map(spectrum, self.thetas.tolist())

    def _spectrum(self, operators: Operators, theta: float, k: int | None = None) -> Spectrum:
        k = self.k if k is None else k
        if self.alpha == 0:
            return operators.lbo(k)
        return operators.albo(self.alpha, theta, k, frame=self.frame, sweeps=self.sweeps, smoothing=self.smoothing)
