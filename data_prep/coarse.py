"""Make a coarse copy of a set of registered shapes, for quick experiments with one connectivity.

Some of the vertices are chosen on the first shape and joined by new faces; every other shape gets the same ones, so the
vertices still correspond. The copy contains the geometry of the set, so its licence is that of the set:

    python data_prep/coarse.py SHAPES OUT --vertices 1000
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
from scipy.spatial import KDTree

from csm._types import IntArray
from csm.data.registry import recognise
from csm.errors import CsmError, DataError
from csm.mesh.io import write_mesh
from csm.mesh.remesh import remesh
from csm.mesh.shape import Mesh


def chosen(mesh: Mesh, n_vertices: int, seed: int = 0) -> tuple[IntArray, IntArray]:
    """Return some vertices of a mesh, (n_vertices,), and the faces between them, counted among these.

    The mesh is remeshed, and each new vertex moved to the nearest old one that no other has taken.
    """
    coarse = remesh(mesh, n_vertices, seed).mesh
    distances, candidates = KDTree(mesh.vertices).query(coarse.vertices, k=min(64, mesh.n_vertices))
    taken: set[int] = set()
    vertices = np.empty(n_vertices, dtype=np.int64)
    for i in np.argsort(distances[:, 0]):
        free = [int(v) for v in candidates[i] if int(v) not in taken]
        if not free:
            raise DataError(f"{mesh.name}: {n_vertices} vertices are too many for {mesh.n_vertices}; ask for fewer")
        vertices[i] = free[0]
        taken.add(free[0])
    return vertices, coarse.faces


def run(shapes: Path, out: Path, n_vertices: int) -> None:
    """Write the coarse copy of a folder of shapes with one connectivity."""
    if out.exists():
        raise FileExistsError
    found = recognise(shapes)
    first = found.mesh(found.names[0])
    vertices, faces = chosen(first, n_vertices)
    out.mkdir(parents=True)
    for name in found.names:
        mesh = found.mesh(name)
        if not np.array_equal(mesh.faces, first.faces):
            raise DataError(f"{shapes}: {name} and {found.names[0]} have different faces; wanted registered shapes")
        write_mesh(out / f"{name}.off", Mesh(mesh.vertices[vertices], faces, name))
    print(f"{out}: {len(found.names)} shapes of {n_vertices} vertices")


def main() -> int:
    """Read the command line and run; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("shapes", type=Path, help="folder of registered shapes")
    parser.add_argument("out", type=Path, help="new folder for the copy")
    parser.add_argument("--vertices", type=int, default=1000)
    given = parser.parse_args()
    try:
        run(given.shapes, given.out, given.vertices)
    except FileExistsError:
        parser.error(f"{given.out} exists already; choose another folder")
    except CsmError as error:
        print(f"coarse: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
