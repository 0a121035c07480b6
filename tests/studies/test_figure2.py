from __future__ import annotations

import numpy as np
import pytest

from csm.errors import ConfigError
from csm.operators.operators import Operators
from csm.studies import figure2
from tests.studies.toys import toy_bodies, toy_context


def test_rows_hold_the_spectra_of_all_operators_on_all_meshes(tmp_path):
    bodies, context = toy_bodies(), toy_context(tmp_path)
    found = figure2.run(context, source=bodies, degrees=(0, 90), k=20)
    assert [row["operator"] for row in found.rows[::2]] == ["isotropic", "anisotropic, 0°", "anisotropic, 90°"]
    assert [row["mesh"] for row in found.rows] == 3 * ["162 vertices", "300 vertices"]
    mesh = bodies.original.load("toy0").mesh
    np.testing.assert_allclose(found.rows[0]["eigenvalues"], Operators(mesh).lbo(20).evals, rtol=1e-9)
    np.testing.assert_allclose(found.rows[4]["eigenvalues"], Operators(mesh).albo(10.0, np.pi / 2, 20).evals, rtol=1e-9)
    assert found.pictures[0].is_file()


def test_changes_are_those_from_the_finest_mesh(tmp_path):
    rows = figure2.run(toy_context(tmp_path), source=toy_bodies(), degrees=(), k=10).rows
    coarse, fine = (np.array(row["eigenvalues"])[1:] for row in rows)
    percent = 100 * np.abs(coarse - fine) / fine
    assert rows[0]["mean change %"] == pytest.approx(percent.mean())
    assert rows[0]["largest change %"] == pytest.approx(percent.max())
    assert rows[1]["mean change %"] == 0


def test_one_eigenvalue_is_too_few(tmp_path):
    with pytest.raises(ConfigError, match="at least 2 eigenvalues"):
        figure2.run(toy_context(tmp_path), source=toy_bodies(), k=1)
