"""Table 2, seconds of every descriptor over the number of vertices, and the body and the stopwatch of both timings."""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator, StrMethodFormatter
from threadpoolctl import threadpool_limits

from csm._parallel import in_fresh_process
from csm._progress import progress_bar
from csm._types import Arrays, FloatArray, IntArray
from csm.data.humans import HumansSet
from csm.data.registry import find_set
from csm.data.variants import Variation
from csm.descriptors.base import record
from csm.descriptors.presets import from_parameters, preset
from csm.errors import ConfigError, DataError
from csm.mesh.remesh import refine
from csm.mesh.shape import Mesh
from csm.operators import Operators
from csm.reproduction.published import RIVALS, SECONDS_AT_6890, family, label
from csm.reproduction.study import Context, Findings, Study
from csm.viewer.style import line_style, new_figure

SHAPE = "tr_reg_000"
"""The body of FAUST that is timed."""

BUSY = 0.8
"""A process that had less than this share of a processor was disturbed by other work."""

REFERENCE = "acd_paper"
"""The descriptor that ratios are taken to."""

Times = dict[tuple[str, int], dict[int, Arrays]]
"""What `time_descriptor` measured: by name of the descriptor and number of threads, then by number of vertices."""

_FOLDERS = {5000: ("FAUST_5k_remeshed",), 6890: ("FAUST_6890", "FAUST_MPI")}
T = TypeVar("T")


def timed_mesh(context: Context, size: int) -> tuple[Mesh, str]:
    """Return a body with (about) so many vertices, and where it comes from.

    It is the published mesh of FAUST where that is there; else FAUST's 6890 vertices are refined or remeshed, and
    without FAUST a built-in human; what is made so is kept in the store.
    """
    try:
        found = find_set(context.root, *_FOLDERS.get(size, (f"FAUST_{size}",)))
        return found.mesh(SHAPE), f"{found.name}/{SHAPE}"
    except DataError:
        pass  # made below, which the second value says
    try:
        original, whence = find_set(context.root, *_FOLDERS[6890]).mesh(SHAPE), f"FAUST {SHAPE}"
    except DataError:
        humans = HumansSet()
        original, whence = humans.load(humans.names[0]).mesh, f"built-in human {humans.names[0]}"
    variation = Variation("refined" if size > original.n_vertices else "remeshed", size, context.seed)
    arrays = variation.of(original, context.store)
    return Mesh(arrays["vertices"], arrays["faces"], original.name), f"{whence}, {variation.variant}"


def measured(
    context: Context, kind: str, mesh: Mesh, question: Mapping[str, Any], measure: Callable[[], Arrays]
) -> Arrays:
    """Return a measurement from the store, or make and store it; its key has mesh, question and machine."""
    machine = f"{platform.machine()}, {os.cpu_count()} processors"
    return context.results.fetch(kind, mesh, {**question, "machine": machine}, measure)


def clocked(run: Callable[[T], object], inputs: Iterable[T]) -> Arrays:
    """Return seconds of the clock ("wall"), and of all threads of the process together ("cpu"), one per input."""
    seconds = []
    for given in inputs:
        clock, work = time.perf_counter(), time.process_time()
        run(given)
        seconds.append((time.perf_counter() - clock, time.process_time() - work))
    wall, cpu = np.array(seconds).T
    return {"wall": wall, "cpu": cpu}


@dataclass(frozen=True)
class Table2(Study):
    """Seconds of every descriptor at every size and number of threads.

    Parameters
    ----------
    sizes
        Numbers of vertices.
    descriptors
        Names of presets.
    threads
        Numbers of threads.
    repeats
        Measurements, of which the median counts.
    """

    sizes: tuple[int, ...] = (5000, 6890, 8000, 10000, 12000, 15000)
    descriptors: tuple[str, ...] = RIVALS
    threads: tuple[int, ...] = (1, 2)
    repeats: int = 3

    def run(self, context: Context) -> Findings:
        """Measure what is missing; ConfigError if there is nothing to do, or a number is below 1."""
        if not (self.sizes and self.descriptors and self.threads) or min(*self.sizes, *self.threads, self.repeats) < 1:
            raise ConfigError(
                f"{self.name}: sizes {self.sizes}, threads {self.threads}, repeats {self.repeats}; wanted counts from 1"
            )
        meshes = {size: timed_mesh(context, size) for size in sorted(self.sizes)}
        threads = sorted(self.threads)
        times: Times = {(name, n): {} for n in threads for name in self.descriptors}
        cells = [(name, size, n) for size in meshes for n in threads for name in self.descriptors]
        with progress_bar(cells, desc="time", unit="cell") as bar:
            for name, size, n in bar:
                bar.set_postfix_str(f"{name}, {size} vertices, {n} threads")
                times[name, n][size] = self._cell(context, name, meshes[size][0], n)
        return self.findings(
            context,
            "Seconds of a descriptor from mesh to values by number of vertices, medians, nothing kept from before.",
            ("descriptor", "threads", *map(str, meshes), "exponent", "to acd", "paper to acd"),
            [_row(name, n, times) for name, n in times],
            _notes(meshes, self.repeats, times),
            times_figure({label(name): _seconds(times[name, threads[0]]) for name in self.descriptors}),
        )

    def _cell(self, context: Context, name: str, mesh: Mesh, threads: int) -> Arrays:
        parameters = record(preset(name))
        question = {"parameters": parameters, "threads": threads, "repeats": self.repeats}
        measure = partial(time_descriptor, mesh, parameters, threads, self.repeats)
        return measured(context, "descriptor-time", mesh, question, measure)


def time_descriptor(mesh: Mesh, parameters: Mapping[str, object], threads: int, repeats: int) -> Arrays:
    """Time a descriptor, given by its record, from mesh to values, see `clocked`, in a fresh process.

    Operators and eigenpairs are made anew in every repeat and nothing is kept; a run on a tiny mesh goes before, so
    that libraries are loaded.  `threads` are those of the linear algebra and OpenMP libraries (threadpoolctl); the
    eigensolver keeps to one of its own accord.
    """
    return in_fresh_process(_timed, mesh.vertices, mesh.faces, dict(parameters), threads, repeats)


def _timed(vertices: FloatArray, faces: IntArray, parameters: dict[str, object], threads: int, repeats: int) -> Arrays:
    descriptor = from_parameters(**parameters)  # type: ignore[arg-type]
    corners = np.array([[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.2], [-1.0, -1.0, 1.1]])
    tetrahedron = Mesh(corners, np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]), "tetrahedron")
    with threadpool_limits(threads):
        descriptor(Operators(refine(tetrahedron, 500).mesh))
        meshes = (Mesh(vertices, faces, "timed") for _ in range(repeats))  # a new one, as a mesh keeps what it computed
        return clocked(lambda mesh: descriptor(Operators(mesh)), meshes)


def exponent(sizes: Sequence[int], seconds: Sequence[float]) -> float | None:
    """Return the slope of log seconds over log vertices, by least squares; None for fewer than two sizes.

    Examples
    --------
    >>> round(exponent([1000, 2000, 4000], [1.0, 4.0, 16.0]), 6)
    2.0
    """
    if len(set(sizes)) < 2:
        return None
    return float(np.polyfit(np.log(sizes), np.log(seconds), 1)[0])


def times_figure(seconds: Mapping[str, Mapping[int, float]]) -> Figure:
    """Plot seconds, by name and number of vertices, over vertices, both logarithmic; exponents are in the legend."""
    figure, axes = new_figure(6.6, 4.4)
    for k, (name, by_size) in enumerate(seconds.items()):
        slope = exponent(list(by_size), list(by_size.values()))
        text = name if slope is None else rf"{name} $\sim N^{{{slope:.1f}}}$"
        axes.plot(list(by_size), list(by_size.values()), marker="o", markersize=4, label=text, **line_style(k))
    axes.set_xscale("log")
    axes.set_yscale("log")
    sizes = sorted({size for by_size in seconds.values() for size in by_size})
    axes.set_xticks(sizes, [f"{size:,}" for size in sizes])
    axes.xaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_locator(LogLocator(10, (1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.set_xlabel("vertices N")
    axes.set_ylabel("seconds")
    figure.legend(loc="outside right center", frameon=False)
    return figure


def _seconds(by_size: Mapping[int, Arrays]) -> dict[int, float]:
    return {size: float(np.median(times["wall"])) for size, times in by_size.items()}


def _row(name: str, threads: int, times: Times) -> dict[str, Any]:
    by_size = times[name, threads]
    seconds, reference = _seconds(by_size), _seconds(times.get((REFERENCE, threads), {}))
    ratios = {str(size): seconds[size] / reference[size] for size in reference}
    middle = str(min(seconds, key=lambda size: abs(size - 6890)))
    paper = SECONDS_AT_6890.get(family(name))
    return {
        "descriptor": name,
        "threads": threads,
        **{str(size): value for size, value in seconds.items()},
        "exponent": exponent(list(seconds), list(seconds.values())),
        "to acd": ratios.get(middle),
        "paper to acd": None if paper is None else paper / SECONDS_AT_6890["acd"],
        "ratios": ratios,
        "measurements": {str(size): {kind: x.tolist() for kind, x in t.items()} for size, t in by_size.items()},
    }


def _notes(meshes: Mapping[int, tuple[Mesh, str]], repeats: int, times: Times) -> list[str]:
    bodies = "; ".join(f"{size}: {whence} ({mesh.n_vertices} vertices)" for size, (mesh, whence) in meshes.items())
    paper = ", ".join(f"{name} {seconds:g}" for name, seconds in SECONDS_AT_6890.items())
    shares = [float(np.median(t["cpu"] / t["wall"])) for by_size in times.values() for t in by_size.values()]
    notes = [
        f"Median of {repeats}; every descriptor computes its own operators and eigenpairs, and no two share any. A "
        "fresh process per cell; threads of linear algebra and OpenMP by threadpoolctl, while the eigensolver keeps to "
        "one thread of its own accord.",
        f"Meshes: {bodies}.",
        f"Ratios to {REFERENCE} are of the size nearest to 6890 vertices, for the same number of threads. The paper "
        f"has at 6890 vertices, in seconds on its machine: {paper}.",
    ]
    if starved := sum(share < BUSY for share in shares):
        cells = f"In {starved} of {len(shares)} cells"
        notes.append(f"{cells} the process had less than {BUSY} of a processor, so other work disturbed it.")
    return notes
