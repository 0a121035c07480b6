from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from csm.errors import ConfigError, DataError
from csm.operators.operators import Operators
from csm.reproduction.resolutions import Figure2, Stability
from csm.reproduction.study import Findings
from tests.reproduction.toys import Toys, measure_no_more, toy_bodies, toy_context


def figure2(folder, **options) -> Findings:
    return Figure2("figure2", source=toy_bodies(), **options).run(toy_context(folder))


def stability(folder, bodies, *descriptors, **options) -> Findings:
    return Stability("stability", source=bodies, descriptors=descriptors, **options).run(toy_context(folder))


def test_rows_hold_the_spectra_of_all_operators_on_all_meshes(tmp_path):
    found = figure2(tmp_path, degrees=(0, 90), k=20)
    assert [row["operator"] for row in found.rows[::2]] == ["isotropic", "anisotropic, 0°", "anisotropic, 90°"]
    assert [row["mesh"] for row in found.rows] == 3 * ["162 vertices", "300 vertices"]
    mesh = toy_bodies().original.load("toy0").mesh
    np.testing.assert_allclose(found.rows[0]["eigenvalues"], Operators(mesh).lbo(20).evals, rtol=1e-9)
    np.testing.assert_allclose(found.rows[4]["eigenvalues"], Operators(mesh).albo(10.0, np.pi / 2, 20).evals, rtol=1e-9)
    assert found.pictures[0].is_file()


def test_changes_are_those_from_the_finest_mesh(tmp_path):
    rows = figure2(tmp_path, degrees=(), k=10).rows
    coarse, fine = (np.array(row["eigenvalues"])[1:] for row in rows)
    percent = 100 * np.abs(coarse - fine) / fine
    assert rows[0]["mean change %"] == pytest.approx(percent.mean())
    assert rows[0]["largest change %"] == pytest.approx(percent.max())
    assert rows[1]["mean change %"] == 0


def test_one_eigenvalue_is_too_few(tmp_path):
    with pytest.raises(ConfigError, match="at least 2 eigenvalues"):
        figure2(tmp_path, k=1)


def test_a_copy_of_the_mesh_changes_nothing(tmp_path):
    bodies = replace(toy_bodies(), others={"a copy": Toys()})
    found = stability(tmp_path, bodies, "acd_isotropic", points=50)
    (row,) = found.rows
    assert (row["change"], row["contrast"], row["error"]) == (0, 0, 0)


def test_another_resolution_changes_a_little_and_is_told_for_each_descriptor(tmp_path):
    names = ("acd_isotropic", "acd_paper")
    found = stability(tmp_path, toy_bodies(), *names, points=50, distance="edge")
    assert [(row["descriptor"], row["mesh"]) for row in found.rows] == [(name, "300 vertices") for name in names]
    for row in found.rows:
        assert 0 < row["change"] < 0.5
        assert 0 < row["contrast"] < 1
        assert 0 < row["error"] < 500
    assert found.pictures[0].is_file()


def test_without_a_triangulation_over_the_same_template_nothing_can_be_compared(tmp_path):
    with pytest.raises(DataError, match="toys has the same template"):
        stability(tmp_path, replace(toy_bodies(), others={}), "hks")


def test_what_is_there_is_not_matched_again(tmp_path, monkeypatch):
    options = {"points": 30, "distance": "edge"}
    first = stability(tmp_path, toy_bodies(), "acd_isotropic", **options)
    measure_no_more(monkeypatch)
    assert stability(tmp_path, toy_bodies(), "acd_isotropic", **options).rows == first.rows


def test_a_descriptor_that_is_the_same_everywhere_has_no_contrast_and_matches_badly(tmp_path):
    (row,) = stability(tmp_path, toy_bodies(), "constant", points=20).rows
    assert (row["change"], row["contrast"]) == (0, 1)
    assert row["error"] > 50
