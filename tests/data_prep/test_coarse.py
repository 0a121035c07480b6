"""data_prep/coarse.py makes registered shapes with fewer vertices."""

import runpy
import sys

import numpy as np
import pytest

from csm.data.registry import recognise
from csm.mesh.check import check
from csm.mesh.io import write_mesh
from csm.mesh.shape import Mesh
from tests.conftest import ROOT
from tests.shapes import blob

SCRIPT = ROOT / "data_prep" / "coarse.py"


@pytest.fixture
def call(monkeypatch):
    def run(*arguments):
        monkeypatch.setattr(sys, "argv", [SCRIPT.name, *map(str, arguments)])
        with pytest.raises(SystemExit) as caught:
            runpy.run_path(str(SCRIPT), run_name="__main__")
        return caught.value.code

    return run


@pytest.fixture
def shapes(tmp_path):
    folder, mesh = tmp_path / "shapes", blob(3)
    folder.mkdir()
    for i in range(3):
        bent = mesh.vertices * [1, 1 + 0.2 * i, 1]
        write_mesh(folder / f"shape{i}.off", Mesh(bent, mesh.faces, f"shape{i}"))
    return folder


def test_the_copies_have_the_same_vertices_and_sound_faces(shapes, tmp_path, call):
    assert call(shapes, tmp_path / "out", "--vertices", 100) == 0
    found = recognise(tmp_path / "out")
    coarse, fine = ([s.mesh(name) for name in s.names] for s in (found, recognise(shapes)))
    assert [mesh.n_vertices for mesh in coarse] == [100, 100, 100]
    gaps = np.linalg.norm(coarse[0].vertices[:, None] - fine[0].vertices, axis=2)
    picked = gaps.argmin(axis=1)
    assert len(set(picked)) == 100
    for few, many in zip(coarse, fine, strict=True):
        np.testing.assert_allclose(few.vertices, many.vertices[picked], atol=1e-6)
        assert [f.kind for f in check(few) if f.severity == "error"] == []
        assert len(few.faces) == 196  # closed, genus 0


def test_nothing_is_overwritten_and_other_faces_are_refused(shapes, tmp_path, call, capsys):
    assert call(shapes, shapes) == 2
    assert "exists already" in capsys.readouterr().err
    mesh = blob(3)
    write_mesh(shapes / "shape2.off", Mesh(mesh.vertices, mesh.faces[::-1], "shape2"))
    assert call(shapes, tmp_path / "out", "--vertices", 100) == 2
    assert "shape2" in capsys.readouterr().err
