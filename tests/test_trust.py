"""What holds and stays so: results do not depend on threads, and nothing in a file is executed or leads elsewhere."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch

from csm.data.store import Store
from csm.descriptors import HKS, preset
from csm.errors import CsmError
from csm.experiments.training import fit
from csm.matching import match_meshes
from csm.matching.network import NetworkMethod, load_model
from csm.mesh.io import read_mesh, write_mesh
from csm.mesh.shape import Mesh
from csm.viewer.match_folder import write_match
from tests.experiments.toys import a_training
from tests.learning.toys import NETWORK
from tests.mesh.test_debris import scattered
from tests.shapes import blob

SPOT = Path(__file__).parent / "cases" / "spot_reference.obj"

WITH_THREADS = """
import hashlib, sys
import numpy as np
from threadpoolctl import threadpool_limits
import torch
import csm
torch.set_num_threads(int(sys.argv[1]))
with threadpool_limits(int(sys.argv[1])):
    mesh = csm.read_mesh(sys.argv[2])
    turned = csm.Mesh(mesh.vertices[:, [1, 2, 0]] * 1.7, mesh.faces, "turned")
    values = csm.ACD.paper()(mesh).values
    match = csm.match_meshes(mesh, turned, csm.ACD.paper(), store=csm.Store(sys.argv[3]))
print(hashlib.sha256(values.tobytes() + match.indices.tobytes() + match.confidence.values.tobytes()).hexdigest())
"""


@pytest.mark.slow
def test_describe_and_match_give_the_same_bytes_with_one_and_two_threads(tmp_path):
    found = set()
    for threads in ("1", "2"):
        environment = {**os.environ, "OMP_NUM_THREADS": threads, "OPENBLAS_NUM_THREADS": threads}
        words = [sys.executable, "-c", WITH_THREADS, threads, str(SPOT), str(tmp_path / threads)]
        found.add(subprocess.run(words, env=environment, capture_output=True, text=True, check=True).stdout)
    assert len(found) == 1


def test_a_training_is_the_same_for_one_number_of_threads(tmp_path):
    one, two = (fit(a_training(tmp_path, 2), tmp_path / name).checkpoint for name in ("one", "two"))
    kept, wanted = (torch.load(path, weights_only=True)["state_dict"] for path in (one, two))
    assert all(torch.equal(kept[name], wanted[name]) for name in wanted)


@pytest.mark.parametrize("name", ["<script>alert(1)</script>", '"><img src=x onerror=alert(1)>', "a\nb", "${x}"])
def test_the_name_of_a_mesh_is_text_on_every_page(tmp_path, name):
    mesh = Mesh(blob(2).vertices, blob(2).faces, name)
    match = match_meshes(mesh, mesh, HKS(k=20, n_times=8), store=Store(tmp_path / "store"))
    write_match(match, tmp_path / "out", "HKS", 0.0)
    page = (tmp_path / "out/match.html").read_text()
    assert "<script>alert" not in page
    assert "<img src=x" not in page
    assert len((tmp_path / "out/map.txt").read_text().splitlines()) == mesh.n_vertices + 1


class Trap:
    """Writes a file when it is unpickled."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self):
        return os.system, (f"touch {self.path}",)


def test_nothing_in_a_file_is_executed(tmp_path):
    trap = tmp_path / "sprung"
    np.savez(tmp_path / "trap.npz", vertices=np.array([Trap(trap)], dtype=object), faces=np.zeros((0, 3), int))
    torch.save({"state_dict": {}, "hyper_parameters": {"network": Trap(trap)}}, tmp_path / "trap.ckpt")
    with pytest.raises(CsmError, match=r"trap\.npz"):
        read_mesh(tmp_path / "trap.npz")
    with pytest.raises(CsmError, match=r"trap\.ckpt"):
        load_model(tmp_path / "trap.ckpt")
    assert not trap.exists()


def test_debris_leaves_a_network_what_it_is(tmp_path):
    """With debris, each vertex of the body has the learned descriptor that it has without."""
    method = NetworkMethod(fit(a_training(tmp_path, 3, network=NETWORK | {"ks": 16}), tmp_path / "run").module)
    mesh, kept = scattered(blob(2), 40, 1e-3)
    alone, among = (method.describe(m, Store(tmp_path / "store")).features for m in (blob(2), mesh))
    torch.testing.assert_close(among[kept], alone, rtol=1e-3, atol=1e-3 * float(alone.abs().max()))


def test_a_mesh_written_and_read_has_the_same_descriptor(tmp_path):
    write_mesh(tmp_path / "a.ply", blob(2))
    np.testing.assert_array_equal(
        preset("gps", k=20)(read_mesh(tmp_path / "a.ply")).values, preset("gps", k=20)(blob(2))
    )
