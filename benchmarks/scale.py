"""Bases and ACD of big meshes: seconds and peak memory over the number of vertices, with the exponents of their growth.

    python benchmarks/scale.py --threads 2 --sizes 30000 100000
    python benchmarks/scale.py --draw results/benchmark_scale.json picture.png

The meshes are a built-in human, remeshed and then subdivided.  Each size runs in a process of its own, so that the peak
is that of the whole process.  The work is what the paper's network needs of a shape: `acd_paper` and 128 functions of
the isotropic Laplacian; the Laplacians and frames are a part of it.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import trimesh
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from measuring import options, write

from csm import Mesh, Operators, load_humans, preset
from csm._peak import peak_megabytes
from csm.mesh.remesh import remesh
from csm.viewer.figures import save_figure
from csm.viewer.style import line_style, plain_axes

SIZES = (30_000, 100_000, 300_000, 1_000_000)
_COARSE = 16_000


@dataclass(frozen=True)
class Row:
    """What was measured of one mesh: seconds of the descriptor, of the functions, and the peak of the process."""

    vertices: int
    acd_paper_s: float
    functions_s: float
    seconds: float
    megabytes: float


def body(n_vertices: int) -> Mesh:
    """Return a human with about so many vertices; each subdivision makes four of one."""
    times = 0
    while n_vertices > _COARSE * 4**times:
        times += 1
    mesh = remesh(load_humans()[0], n_vertices // 4**times)
    vertices, faces = mesh.mesh.vertices, mesh.mesh.faces
    for _ in range(times):
        vertices, faces = trimesh.remesh.subdivide(vertices, faces)
    return Mesh(vertices, faces, f"human of {len(vertices)}")


def measured(file: Path) -> Row:
    """Measure the mesh of a file in this process."""
    with np.load(file) as arrays:
        mesh = Mesh(arrays["vertices"], arrays["faces"], file.stem)
    begun = time.perf_counter()
    operators = Operators(mesh)
    operators.lbo(128)  # first, as csm prepare does
    between = time.perf_counter()
    preset("acd_paper")(operators)
    done = time.perf_counter()
    return Row(mesh.n_vertices, done - between, between - begun, done - begun, peak_megabytes())


def in_a_process(n_vertices: int, threads: int, folder: Path) -> Row:
    """Make a mesh and measure it in a fresh process."""
    mesh, file = body(n_vertices), folder / f"{n_vertices}.npz"
    np.savez(file, vertices=mesh.vertices, faces=mesh.faces)
    limits = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), str(threads))
    line = [sys.executable, __file__, "--of", str(file)]
    done = subprocess.run(line, check=True, stdout=subprocess.PIPE, text=True, env=os.environ | limits)
    return Row(**json.loads(done.stdout.splitlines()[-1]))


def exponent(rows: list[Row], value: str) -> float:
    """Return the power of the number of vertices that a column grows with, by least squares of the logarithms."""
    n, y = (np.log([getattr(row, name) for row in rows]) for name in ("vertices", value))
    return float(np.polyfit(n, y, 1)[0])


def draw(results: Path, picture: Path) -> None:
    """Draw seconds and megabytes of a result over the number of vertices, with the powers that they grow with."""
    rows = [Row(**row) for row in json.loads(results.read_text(encoding="utf-8"))["rows"]]
    figure = Figure(figsize=(8.0, 3.2), layout="constrained")
    FigureCanvasAgg(figure)
    panels = {
        "s": {"acd_paper": "acd_paper_s", "128 functions": "functions_s", "both": "seconds"},
        "MB, peak of the process": {"both": "megabytes"},
    }
    for axes, (label, columns) in zip(figure.subplots(1, 2), panels.items(), strict=True):
        for i, (name, column) in enumerate(columns.items()):
            grown = f"{name}: power {exponent(rows, column):.2f}"
            values = [getattr(row, column) for row in rows]
            axes.loglog([row.vertices for row in rows], values, "o", label=grown, **line_style(i))
        plain_axes(axes)
        axes.set_xlabel("vertices")
        axes.set_ylabel(label)
        axes.legend(fontsize=8)
    save_figure(picture, figure)


def main() -> None:
    chosen = options("scale", __doc__, [], repeats=1, sizes=SIZES)
    rows = []
    with TemporaryDirectory() as folder:
        for n in chosen.sizes:
            rows.append(row := in_a_process(n, chosen.threads, Path(folder)))
            print(
                f"{row.vertices:>9,} vertices  acd_paper {row.acd_paper_s:7.1f} s  128 functions "
                f"{row.functions_s:7.1f} s  together {row.seconds:7.1f} s  peak {row.megabytes:6.0f} MB",
                flush=True,
            )
    found = (
        {f"exponent_of_{value}": exponent(rows, value) for value in ("seconds", "megabytes")} if len(rows) > 1 else {}
    )
    print(found)
    write("scale", chosen, found, rows)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--of"]:
        print(json.dumps(asdict(measured(Path(sys.argv[2])))))
    elif sys.argv[1:2] == ["--draw"]:
        draw(Path(sys.argv[2]), Path(sys.argv[3]))
    else:
        main()
