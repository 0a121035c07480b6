"""Small folders in the layouts of the published sets, made of synthetic meshes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import scipy.io

from csm.mesh.io import write_map, write_mesh
from csm.mesh.shape import Mesh
from tests.shapes import sphere


def patch(n: int) -> Mesh:
    """A fan of n vertices: a mesh of any wanted size."""
    angle = np.linspace(0, 5, n - 1)
    ring = np.stack([np.cos(angle), np.sin(angle), 0.1 * angle], axis=1)
    inner = np.arange(1, n - 1)
    return Mesh(np.concatenate([[[0, 0, 1.0]], ring]), np.stack([0 * inner, inner, inner + 1], axis=1))


def write_mat(path: Path, mesh: Mesh) -> None:
    x, y, z = mesh.vertices.T[:, :, None]
    path.parent.mkdir(parents=True, exist_ok=True)
    scipy.io.savemat(path, {"shape": {"X": x, "Y": y, "Z": z, "TRIV": mesh.faces + 1}})


def mpi_faust(root: Path, names: tuple[str, ...] = ("tr_reg_000", "tr_reg_001")) -> Path:
    for name in names:
        write_mesh(root / "MPI-FAUST" / "training" / "registrations" / f"{name}.ply", patch(6890))
    return root


def acd(root: Path, names: tuple[str, ...] = ("mesh000", "mesh052"), n_classes: int = 50) -> Path:
    mesh = sphere(1)
    for name in names:
        write_mat(root / "shapes" / f"{name}.mat", mesh)
        (root / "labels").mkdir(exist_ok=True)
        labels = np.random.default_rng(0).integers(1, mesh.n_vertices + 1, (n_classes, 1))
        scipy.io.savemat(root / "labels" / f"{name}.mat", {"labels": labels.astype(float)})
    (root / "files_train.txt").write_text(f"{names[0]}\n")
    (root / "files_test.txt").write_text(f"{names[1]}\n")
    return root


def lps(root: Path, names: tuple[str, ...] = ("tr_reg_080", "tr_reg_081"), n: int = 8000) -> Path:
    for name in names:
        write_mesh(root / f"{name}.off", patch(n))
    return root


def sga18(root: Path, names: tuple[str, ...] = ("cat0", "cat10", "dog0")) -> Path:
    mesh = sphere(1)
    for name in names:
        write_mesh(root / "vtx_5k" / f"{name}.off", mesh)
        write_map(root / "vtx_5k" / "corres" / f"{name}.vts", np.arange(30))
        write_map(root / "vtx_5k" / "corres" / f"{name}.sym.vts", np.arange(30)[::-1])
    write_map(root / "vtx_5k" / "corres" / "sampleID.vts", np.arange(30))
    (root / "test_pairs.txt").write_text(f"{names[0]}\t{names[1]}\n{names[0]} {names[2]}\n")
    return root


def shrec19(root: Path) -> Path:
    for name in ("1", "2", "10"):
        write_mesh(root / f"{name}.obj", sphere(1))
    for name in ("1", "10"):
        write_map(root / "derived_smpl_vts" / f"{name}.vts", np.arange(40))
    (root / "test_pairs.txt").write_text("1 2\n1 10\n")
    return root
