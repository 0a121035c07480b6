"""Seconds of a descriptor on a mesh, from an empty store, in a process of its own with a given number of threads."""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

import numpy as np
from threadpoolctl import threadpool_limits

from csm._types import FloatArray, IntArray
from csm.descriptors.presets import from_parameters
from csm.mesh.remesh import refine
from csm.mesh.shape import Mesh
from csm.operators.operators import Operators


@dataclass(frozen=True)
class Timed:
    """How long a descriptor took.

    Parameters
    ----------
    wall, cpu
        Seconds of the clock, and of all threads of the process together, one number per repeat.
    """

    wall: tuple[float, ...]
    cpu: tuple[float, ...]

    @property
    def seconds(self) -> float:
        """Median of the clock."""
        return float(np.median(self.wall))

    @property
    def share(self) -> float:
        """Median of processor time over clock time: about the number of threads that were at work."""
        return float(np.median(np.array(self.cpu) / np.array(self.wall)))


def time_descriptor(mesh: Mesh, parameters: Mapping[str, object], threads: int, repeats: int) -> Timed:
    """Time a descriptor from mesh to values, in a fresh process.

    Operators and eigenpairs are made anew in every repeat and nothing is kept; a run on a tiny mesh goes before, so
    that libraries are loaded.

    Parameters
    ----------
    mesh
        The shape.
    parameters
        `name` and the parameters of the descriptor, as `csm.descriptors.presets.from_parameters` takes them.
    threads
        Of the linear algebra and OpenMP libraries (threadpoolctl).  The eigensolver keeps to one of its own accord.
    repeats
        Number of measurements, from 1.
    """
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        return pool.submit(_timed, mesh.vertices, mesh.faces, dict(parameters), threads, repeats).result()


def _timed(vertices: FloatArray, faces: IntArray, parameters: dict[str, object], threads: int, repeats: int) -> Timed:
    descriptor = from_parameters(**parameters)  # type: ignore[arg-type]
    wall, cpu = [], []
    with threadpool_limits(threads):
        descriptor(Operators(_tiny()))
        for _ in range(repeats):
            mesh = Mesh(vertices, faces, "timed")  # a new one, as a mesh keeps what it has computed
            clock, work = time.perf_counter(), time.process_time()
            descriptor(Operators(mesh))
            wall.append(time.perf_counter() - clock)
            cpu.append(time.process_time() - work)
    return Timed(tuple(wall), tuple(cpu))


def _tiny() -> Mesh:
    corners = np.array([[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.2], [-1.0, -1.0, 1.1]])
    return refine(Mesh(corners, np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]), "tetrahedron"), 500).mesh
