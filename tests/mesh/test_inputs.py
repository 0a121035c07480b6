from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import torch
import trimesh

import csm
from csm.errors import ConfigError, MeshError
from csm.mesh.inputs import as_mesh, as_polygons
from csm.mesh.io import write_mesh
from csm.mesh.polygons import PolygonMesh
from tests.shapes import blob

CASES = Path(__file__).parent.parent / "cases"
MESH = blob(1)
KINDS = {
    "csm": MESH,
    "polygons": PolygonMesh.of(MESH),
    "pair": (MESH.vertices, MESH.faces),
    "list": [MESH.vertices.tolist(), MESH.faces.tolist()],
    "torch": (torch.as_tensor(MESH.vertices.copy()).requires_grad_(), torch.as_tensor(MESH.faces.copy())),
    "trimesh": trimesh.Trimesh(MESH.vertices, MESH.faces, process=False),
    "object": SimpleNamespace(vertices=MESH.vertices, faces=MESH.faces.astype(np.uint32)),
}
each = pytest.mark.parametrize("given", KINDS.values(), ids=KINDS)


@each
def test_every_kind_becomes_the_same_mesh(given):
    mesh = as_mesh(given, "mine")
    assert mesh.digest == MESH.digest
    assert mesh.name == ("blob" if given in (MESH, KINDS["polygons"]) else "mine")


@each
@pytest.mark.parametrize(
    "call",
    [csm.HKS(k=5), csm.check, lambda m: csm.clean(m).mesh.digest, lambda m: csm.geodesics(m).diameter(), csm.Operators],
    ids=["descriptor", "check", "clean", "geodesics", "operators"],
)
def test_what_takes_a_mesh_takes_every_kind(call, given):
    found, wanted = call(given), call(MESH)
    if isinstance(found, csm.Operators):
        found, wanted = found.mesh.digest, wanted.mesh.digest
    np.testing.assert_array_equal(found, wanted)


@pytest.mark.parametrize("kind", [str, Path])
def test_a_path_is_read(tmp_path, kind):
    write_mesh(tmp_path / "a.off", MESH)
    mesh = as_mesh(kind(tmp_path / "a.off"), "mine")
    assert (mesh.digest, mesh.name) == (MESH.digest, "a")
    np.testing.assert_array_equal(csm.HKS(k=5)(kind(tmp_path / "a.off")), csm.HKS(k=5)(MESH))


def test_polygons_stay_polygons_where_they_may_and_are_refused_elsewhere():
    quads = as_polygons(CASES / "quads.ply")
    assert as_polygons(quads) is quads
    with pytest.raises(MeshError, match="corners"):
        as_mesh(quads)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (np.zeros((4, 3)), r"got an array of shape \(4, 3\) alone; give both, \(vertices, faces\)"),
        (torch.zeros(4, 3), r"got an array of shape \(4, 3\) alone"),
        (
            trimesh.Scene([trimesh.creation.box()]),
            r"got a Scene, which may hold several meshes; take one .*scene\.to_mesh\(\)",
        ),
        (trimesh.PointCloud(np.zeros((4, 3))), "got a PointCloud, which has vertices but no faces"),
        ((MESH.vertices,), "got a tuple of 1"),
        (7, "got a int"),
    ],
)
def test_what_is_no_mesh_is_named(given, said):
    with pytest.raises(ConfigError, match=said):
        as_mesh(given)


def test_a_pair_in_the_wrong_order_or_shape_is_named():
    with pytest.raises(MeshError, match=r"mine: faces hold .*, wanted whole numbers"):
        as_mesh((MESH.faces, MESH.vertices), "mine")
    with pytest.raises(MeshError, match=r"mine: faces have shape \(5, 4\)"):
        as_mesh((MESH.vertices, np.zeros((5, 4), dtype=int)), "mine")


def test_neither_trimesh_nor_torch_is_loaded_for_it():
    code = "import sys, csm.mesh.inputs; sys.exit(bool({'trimesh', 'torch'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
