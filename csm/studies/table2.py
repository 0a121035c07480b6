"""Table 2: seconds of every descriptor over the number of vertices, with exponents and ratios to ACD."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator, StrMethodFormatter

from csm._progress import progress_bar
from csm.data.datasets import find_set
from csm.data.humansset import HumansSet, remeshed
from csm.data.store import Store
from csm.descriptors.base import record
from csm.descriptors.presets import preset
from csm.errors import ConfigError, DataError
from csm.mesh.shape import Mesh
from csm.studies.bodies import RIVALS, label
from csm.studies.kept import kept, this_machine
from csm.studies.published import SECONDS_AT_6890, family
from csm.studies.study import Context, Findings
from csm.studies.timing import Timed, time_descriptor
from csm.viewer.figures import save_figure
from csm.viewer.style import line_style, new_figure

SHAPE = "tr_reg_000"
"""The body of FAUST that is timed."""

REFERENCE = "acd_paper"
"""The descriptor that ratios are taken to."""

_FOLDERS = {5000: ("FAUST_5k_remeshed",), 6890: ("FAUST_6890", "FAUST_MPI")}


def run(
    context: Context,
    *,
    sizes: Sequence[int] = (5000, 6890, 8000, 10000, 12000, 15000),
    descriptors: Sequence[str] = RIVALS,
    threads: Sequence[int] = (1, 2),
    repeats: int = 3,
) -> Findings:
    """Time every descriptor at every size and number of threads.

    Parameters
    ----------
    context
        Where data and artefacts are; times that are in its folder are not measured again.
    sizes
        Numbers of vertices.
    descriptors
        Names of presets.
    threads
        Numbers of threads.
    repeats
        Measurements, of which the median counts.

    Raises
    ------
    ConfigError
        If there is nothing to do, or a number is below 1.
    """
    if not (sizes and descriptors and threads) or min([*sizes, *threads, repeats]) < 1:
        raise ConfigError(f"table2: sizes {sizes}, threads {threads}, repeats {repeats}; wanted numbers from 1")
    chosen = {name: record(preset(name)) for name in descriptors}
    meshes = {size: timed_mesh(context.root, context.store, size, context.seed) for size in sorted(sizes)}
    times: dict[tuple[str, int, int], Timed] = {}
    with progress_bar(total=len(chosen) * len(sizes) * len(threads), desc="time", unit="cell") as bar:
        for size, (mesh, _) in meshes.items():
            for count in sorted(threads):
                for name, parameters in chosen.items():
                    bar.set_postfix_str(f"{name}, {size} vertices, {count} threads")
                    path = context.out / "times" / f"{name}_{size}_{count}.json"
                    times[name, size, count] = _cell(path, mesh, parameters, count, repeats)
                    bar.update()
    rows = [_row(name, count, sorted(sizes), times) for count in sorted(threads) for name in descriptors]
    path = context.out / "table2.png"
    save_figure(path, times_figure({label(name): _seconds(name, min(threads), times) for name in descriptors}))
    shown = ("descriptor", "threads", *map(str, sorted(sizes)), "exponent", "to acd", "paper to acd")
    title = "Seconds of a descriptor from mesh to values by number of vertices, medians, nothing kept from before."
    return Findings("table2", title, shown, rows, _notes(meshes, repeats, times), (path,))


def timed_mesh(root: Path, store: Store, size: int, seed: int = 0) -> tuple[Mesh, str]:
    """Return a body with (about) so many vertices, and where it comes from.

    It is the published mesh of FAUST where that is below `root`; else FAUST's 6890 vertices are refined or remeshed,
    and without FAUST a built-in human; what is made so is kept in the store.
    """
    names = _FOLDERS.get(size, (f"FAUST_{size}",))
    try:
        found = find_set(root, *names)
        return found.mesh(SHAPE), f"{found.name}/{SHAPE}"
    except DataError:
        pass  # made below, which the second value says
    try:
        original, whence = find_set(root, *_FOLDERS[6890]).mesh(SHAPE), f"FAUST {SHAPE}"
    except DataError:
        humans = HumansSet()
        original, whence = humans.load(humans.names[0]).mesh, f"built-in human {humans.names[0]}"
    variant = "refined" if size > original.n_vertices else "remeshed"
    arrays = remeshed(original, variant, size, seed, store)
    return Mesh(arrays["vertices"], arrays["faces"], original.name), f"{whence}, {variant}"


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
    """Plot seconds over vertices, both logarithmic, with the exponents in the legend.

    Parameters
    ----------
    seconds
        Name of the descriptor -> number of vertices -> seconds.
    """
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


def _cell(path: Path, mesh: Mesh, parameters: Mapping[str, Any], threads: int, repeats: int) -> Timed:
    question = {"mesh": mesh.digest, "parameters": dict(parameters), "threads": threads, "repeats": repeats}
    answer = kept(
        path,
        {**question, "machine": this_machine()},
        lambda: asdict(time_descriptor(mesh, parameters, threads, repeats)),
    )
    return Timed(tuple(answer["wall"]), tuple(answer["cpu"]))


def _seconds(name: str, threads: int, times: Mapping[tuple[str, int, int], Timed]) -> dict[int, float]:
    return {size: timed.seconds for (n, size, t), timed in times.items() if (n, t) == (name, threads)}


def _row(name: str, threads: int, sizes: Sequence[int], times: Mapping[tuple[str, int, int], Timed]) -> dict[str, Any]:
    seconds = _seconds(name, threads, times)
    reference = _seconds(REFERENCE, threads, times)
    ratios = {str(size): seconds[size] / reference[size] for size in sizes if size in reference}
    middle = str(min(sizes, key=lambda size: abs(size - 6890)))
    paper = SECONDS_AT_6890.get(family(name))
    return {
        "descriptor": name,
        "threads": threads,
        **{str(size): seconds[size] for size in sizes},
        "exponent": exponent(sizes, [seconds[size] for size in sizes]),
        "to acd": ratios.get(middle),
        "paper to acd": None if paper is None else paper / SECONDS_AT_6890["acd"],
        "ratios": ratios,
        "measurements": {str(size): asdict(times[name, size, threads]) for size in sizes},
    }


def _notes(
    meshes: Mapping[int, tuple[Mesh, str]], repeats: int, times: Mapping[tuple[str, int, int], Timed]
) -> tuple[str, ...]:
    bodies = "; ".join(f"{size}: {whence} ({mesh.n_vertices} vertices)" for size, (mesh, whence) in meshes.items())
    paper = ", ".join(f"{name} {seconds:g}" for name, seconds in SECONDS_AT_6890.items())
    starved = sum(timed.share < 0.8 for timed in times.values())
    busy = (
        f"In {starved} of {len(times)} cells the process had less than 0.8 of a processor, so other work disturbed it."
    )
    notes = (
        f"Median of {repeats}; every descriptor computes its own operators and eigenpairs, and no two share any. A "
        "fresh process per cell; threads of linear algebra and OpenMP by threadpoolctl, while the eigensolver keeps to "
        "one thread of its own accord.",
        f"Meshes: {bodies}.",
        f"Ratios to {REFERENCE} are of the size nearest to 6890 vertices, for the same number of threads. The paper "
        f"has at 6890 vertices, in seconds on its machine: {paper}.",
    )
    return (*notes, busy) if starved else notes
