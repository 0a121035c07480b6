"""Toy shapes in the published layout of the remeshed sets, for studies that look for these by name."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from csm.mesh.io import write_map, write_mesh
from csm.mesh.shape import Mesh
from tests.shapes import blob

N = 162


def _bent(i: int, name: str) -> Mesh:
    base = blob(2)
    rng = np.random.default_rng(i)
    bend = 0.1 * np.sin(base.vertices @ rng.normal(size=(3, 3)) + rng.uniform(0, 6, 3))
    order = np.random.default_rng(100 + i).permutation(N)
    place = np.argsort(order)
    return Mesh((base.vertices + bend)[order], place[base.faces], name)


def write_faust(root: Path) -> Path:
    """Write two persons with two poses each, and pairs within and between them; vertices come in random order."""
    for i, name in enumerate(("tr_reg_000", "tr_reg_001", "tr_reg_010", "tr_reg_011")):
        _write_sga18(root, i, name)
    pairs = "tr_reg_000 tr_reg_001\ntr_reg_001 tr_reg_000\ntr_reg_010 tr_reg_011\ntr_reg_000 tr_reg_011\n"
    (root / "test_pairs.txt").write_text(pairs)
    return root


def write_tosca(root: Path) -> Path:
    """Write three cats and the pairs among them."""
    for i, name in enumerate(("cat0", "cat1", "cat2")):
        _write_sga18(root, 10 + i, name)
    (root / "test_pairs.txt").write_text("cat0 cat1\ncat1 cat2\n")
    return root


def write_shrec19(root: Path) -> Path:
    """Write three shapes of which the last has no map, and pairs with and without ground truth."""
    for i, name in enumerate(("1", "2", "10")):
        write_mesh(root / f"{name}.obj", _bent(20 + i, name))
    for i, name in enumerate(("1", "2")):
        write_map(root / "derived_smpl_vts" / f"{name}.vts", _order(20 + i))
    (root / "test_pairs.txt").write_text("1 2\n1 10\n2 1\n")
    return root


def _write_sga18(root: Path, i: int, name: str) -> None:
    write_mesh(root / "vtx_5k" / f"{name}.off", _bent(i, name))
    write_map(root / "vtx_5k" / "corres" / f"{name}.vts", _order(i))
    write_map(root / "vtx_5k" / "corres" / f"{name}.sym.vts", _order(i)[::-1])


def _order(i: int) -> np.ndarray:
    """Return the vertex of every template point."""
    return np.argsort(np.random.default_rng(100 + i).permutation(N))
