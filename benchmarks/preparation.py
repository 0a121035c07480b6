"""Time of preparing shapes for a training, on two processes, against a serial loop over the plain library call.

    python benchmarks/preparation.py --threads 2

Each shape needs the eigensystems of csm's own setting of ACD and 256 functions of the isotropic Laplacian.  The
reference computes one shape after the other on one thread, as `eigensystems.py` does, with csm's own matrices, and
writes nothing; csm writes features and basis into an empty store.  The first two of csm's eight shapes stand for all of
them.  `--threads` is the number of csm's processes, of one thread each.
"""

from __future__ import annotations

import statistics
import time
from dataclasses import dataclass
from tempfile import TemporaryDirectory

from eigensystems import plain
from measuring import options, write
from threadpoolctl import threadpool_limits

from csm import ACD, Mesh, Operators
from csm.data.humans import HumansSet
from csm.data.prepare import Job, Recipe, prepare
from csm.data.store import Store
from csm.operators.laplacian import stiffness

SHAPES, REFERENCE_SHAPES, BASIS, GOAL = 8, 2, 256, 6.0


@dataclass(frozen=True)
class Row:
    """Seconds per shape, medians over the repeats."""

    work: str
    vertices: int
    reference_ms: float
    csm_ms: float
    ratio: float
    goal: float


def reference(mesh: Mesh) -> None:
    operators, acd = Operators(mesh), ACD()
    matrices = operators.anisotropic(frame=acd.frame, sweeps=acd.sweeps, smoothing=acd.smoothing)
    for theta in acd.thetas:
        plain(matrices.at(acd.alpha, theta), operators.mass, acd.eigenpairs)
    plain(stiffness(operators.mesh), operators.mass, BASIS)


def main() -> None:
    chosen = options("preparation", __doc__, ["csm"], repeats=3)
    humans = HumansSet()
    names = humans.names[:SHAPES]
    jobs = [Job(humans, name) for name in names]
    theirs, ours = [], []
    for _ in range(chosen.repeats):
        with threadpool_limits(1):
            begun = time.perf_counter()
            for name in names[:REFERENCE_SHAPES]:
                reference(humans.load(name).mesh)
            theirs.append((time.perf_counter() - begun) / REFERENCE_SHAPES)
        with TemporaryDirectory() as folder:
            begun = time.perf_counter()
            prepare(jobs, [Recipe(ACD(), BASIS)], Store(folder), workers=chosen.threads)
            ours.append((time.perf_counter() - begun) / SHAPES)
    ratio = statistics.median(a / b for a, b in zip(theirs, ours, strict=True))
    vertices = humans.load(names[0]).mesh.n_vertices
    a, b = (1e3 * statistics.median(each) for each in (theirs, ours))
    print(f"per shape: reference {a:.0f} ms, csm {b:.0f} ms, ratio {ratio:.2f}")
    write("preparation", chosen, {"shapes": SHAPES}, [Row("acd and 256 functions", vertices, a, b, ratio, GOAL)])


if __name__ == "__main__":
    main()
