from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from csm import interop
from csm.errors import ConfigError, MeshError
from tests.shapes import blob

LIBRARIES = {
    "trimesh": "trimesh",
    "meshio": "meshio",
    "pyvista": "pyvista",
    "open3d": "open3d",
    "pyg": "torch_geometric",
    "pyfm": "pyFM",
    "geomfum": "geomfum",
}


@pytest.mark.parametrize("name", LIBRARIES)
def test_a_mesh_comes_back_as_it_was(name):
    pytest.importorskip(LIBRARIES[name])
    mesh = blob(2)
    there = getattr(interop, f"to_{name}")(mesh)
    back = getattr(interop, f"from_{name}")(there, "back")
    assert back.name == "back"
    np.testing.assert_array_equal(back.faces, mesh.faces)
    np.testing.assert_allclose(back.vertices, mesh.vertices, rtol=0, atol=1e-6 if name in ("pyg", "pyvista") else 0)


@pytest.mark.parametrize("name", ["meshio", "pyvista"])
def test_values_of_vertices_go_along(name):
    pytest.importorskip(name)
    mesh = blob(1)
    made = getattr(interop, f"to_{name}")(mesh, {"height": mesh.vertices[:, 2]})
    np.testing.assert_array_equal(np.asarray(made.point_data["height"]), mesh.vertices[:, 2])


def test_what_are_no_triangles_is_refused():
    meshio = pytest.importorskip("meshio")
    quad = meshio.Mesh(np.eye(4)[:, :3], [("quad", [[0, 1, 2, 3]])])
    with pytest.raises(MeshError, match="it: the object of meshio has cells quad; wanted triangles only"):
        interop.from_meshio(quad, "it")


def test_a_missing_library_is_said_in_a_sentence(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyFM.mesh", None)
    with pytest.raises(ConfigError, match=r"pyFM\.mesh is not installed: pip install pyfmaps"):
        interop.to_pyfm(blob(1))


def test_nothing_is_imported_before_it_is_needed():
    code = f"import sys, csm.interop; print([name for name in {list(LIBRARIES.values())} if name in sys.modules])"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert found.strip() == "[]"
