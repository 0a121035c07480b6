from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from csm.descriptors import preset
from csm.errors import MeshError
from csm.mesh.shape import Mesh
from csm.operators import Operators
from csm.operators import operators as module
from tests.mesh.test_debris import scattered
from tests.shapes import blob, sphere


class Shelf:
    """A memo that keeps arrays under a key made of plain data, as a file would."""

    def __init__(self):
        self.kept, self.made = {}, []

    def fetch(self, kind, mesh, params, make):
        key = (kind, mesh.digest, json.dumps(params, sort_keys=True))
        if key not in self.kept:
            self.made.append(kind)
            self.kept[key] = {name: array.copy() for name, array in make().items()}
        return self.kept[key]


def test_area_is_one_and_the_way_back_is_kept():
    big = replace(blob(2), vertices=7.0 * blob(2).vertices)
    operators = Operators(big)
    assert operators.mesh.area == pytest.approx(1)
    np.testing.assert_allclose(operators.mesh.vertices * operators.mesh.scale, big.vertices)
    assert operators.mass.sum() == pytest.approx(1)
    assert Operators(big, unit_area=False).mesh is big


def test_scale_plays_no_part_at_unit_area():
    mesh = blob(3)
    big = Operators(replace(mesh, vertices=3.0 * mesh.vertices))
    np.testing.assert_allclose(big.lbo(10).evals, Operators(mesh).lbo(10).evals, atol=1e-8)
    np.testing.assert_allclose(big.albo(10, 1, 10).evals, Operators(mesh).albo(10, 1, 10).evals, atol=1e-8)


def test_nothing_is_computed_before_or_twice(monkeypatch):
    calls = []
    for name in ("face_frames", "eigenpairs"):
        honest = getattr(module, name)
        monkeypatch.setattr(module, name, lambda *a, n=name, f=honest, **k: calls.append(n) or f(*a, **k))
    operators = Operators(blob(2))
    assert calls == []
    assert operators.lbo(5) is operators.lbo(5)
    assert calls == ["eigenpairs"]
    operators.albo(10, 0.0, 5), operators.albo(10, 0.5, 5), operators.albo(10, 0.5, 5)
    assert calls == ["eigenpairs", "face_frames", "eigenpairs", "eigenpairs"]


def test_fewer_pairs_are_taken_from_more_and_are_those_of_an_own_solution(monkeypatch):
    solved = []
    honest = module.eigenpairs
    monkeypatch.setattr(module, "eigenpairs", lambda *a, **k: solved.append(a[2]) or honest(*a, **k))
    both = Operators(blob(3))
    for ask in (lambda o, k: o.lbo(k), lambda o, k: o.albo(10, 0.5, k)):
        more, fewer, own = ask(both, 60), ask(both, 25), ask(Operators(blob(3)), 25)
        np.testing.assert_array_equal(fewer.evals, more.evals[:25])
        np.testing.assert_allclose(fewer.evals, own.evals, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(fewer.evecs, own.evecs, atol=1e-7)
    assert solved == [60, 25, 60, 25]
    both.albo(10, 0.6, 25), both.albo(4, 0.5, 25), both.albo(10, 0.5, 25, sweeps=2), both.lbo(61)
    assert solved[4:] == [25, 25, 25, 61]


def test_a_memo_is_asked_with_plain_data_and_its_answer_is_the_same():
    mesh, shelf = blob(2), Shelf()
    first, second = Operators(mesh, memo=shelf), Operators(mesh, memo=shelf)
    for solve in (lambda o: o.lbo(6), lambda o: o.albo(np.float64(10), np.float64(0.5), np.int64(6))):
        made, kept = solve(first), solve(second)
        for field in ("evals", "evecs", "mass"):
            np.testing.assert_array_equal(getattr(made, field), getattr(kept, field))
        assert (made.residual, made.notes) == (kept.residual, kept.notes)
    assert shelf.made == ["lbo", "albo"]


def test_a_memo_also_gets_fewer_pairs_that_were_taken_from_more(monkeypatch):
    solved, shelf, mesh = [], Shelf(), blob(3)
    honest = module.eigenpairs
    monkeypatch.setattr(module, "eigenpairs", lambda *a, **k: solved.append(a[2]) or honest(*a, **k))
    for ask in (lambda o, k: o.lbo(k), lambda o, k: o.albo(10, 0.5, k)):
        first, later = Operators(mesh, memo=shelf), Operators(mesh, memo=shelf)
        more, fewer = ask(first, 30), ask(first, 12)
        np.testing.assert_array_equal(fewer.evecs, more.evecs[:, :12])
        assert fewer is ask(first, 12)
        again = ask(later, 12)
        for field in ("evals", "evecs", "mass"):
            np.testing.assert_array_equal(getattr(again, field), getattr(fewer, field))
        assert (again.residual, again.notes) == (more.residual, more.notes)
    assert solved == [30, 30], "fewer pairs are solved for neither in the first place nor when looked up later"
    assert shelf.made == ["lbo", "lbo", "albo", "albo"]


def test_what_a_memo_holds_already_is_not_replaced_by_a_part_of_more():
    mesh, shelf = blob(2), Shelf()
    own = Operators(mesh, memo=shelf).lbo(6)
    both = Operators(mesh, memo=shelf)
    both.lbo(20)
    np.testing.assert_array_equal(both.lbo(6).evecs, own.evecs)
    assert shelf.made == ["lbo", "lbo"]


def test_every_parameter_is_part_of_the_memo_key():
    shelf = Shelf()
    operators = Operators(blob(2), memo=shelf)
    asked = [{}, {"alpha": 4.0}, {"theta": 0.2}, {"k": 7}, {"frame": "released"}, {"sweeps": 1}]
    for change in asked:
        operators.albo(**({"alpha": 10.0, "theta": 0.1, "k": 6} | change))
    assert shelf.made == ["albo"] * len(asked)


def test_floored_faces_are_recorded_also_through_a_memo():
    square = np.array([[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0], [1, 1, 0.0]])
    mesh, shelf = Mesh(square, np.array([[0, 1, 2], [0, 2, 4], [0, 4, 3], [4, 2, 3]]), "flap"), Shelf()
    for _ in range(2):
        (note,) = Operators(mesh, memo=shelf).lbo(2).notes
        assert "1 face has" in note
        assert "face 1" in note


def test_a_mesh_that_cannot_carry_a_laplacian_is_refused():
    broken = Mesh(np.where(np.arange(42)[:, None] == 7, np.nan, sphere(1).vertices), sphere(1).faces, "broken")
    with pytest.raises(MeshError, match="broken"):
        Operators(broken)


@pytest.mark.parametrize("ask", [lambda o: o.lbo(12), lambda o: o.albo(10.0, 0.4, 12)], ids=["lbo", "albo"])
def test_debris_leaves_the_spectrum_of_the_body_as_it_is(ask):
    mesh, kept = scattered(blob(3), 30, 1e-3)
    alone, among = ask(Operators(blob(3))), ask(Operators(mesh))
    np.testing.assert_allclose(among.evals, alone.evals, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(among.evecs[kept] ** 2, alone.evecs**2, rtol=1e-5, atol=1e-6)
    out = np.setdiff1d(np.arange(mesh.n_vertices), kept)
    assert not among.evecs[out].any()
    assert not among.mass[out].any()
    assert among.evecs.T @ (among.mass[:, None] * among.evecs) == pytest.approx(np.eye(12), abs=1e-8)
    assert "30 components of less than 1% of the area" in among.notes[0]


@pytest.mark.parametrize("name", ["acd", "acd_release", "hks", "wks", "shot", "dep", "weds", "wft"])
def test_debris_leaves_descriptors_of_the_body_as_they_are(name):
    mesh, kept = scattered(blob(3), 30, 1e-3)
    alone, among = preset(name)(blob(3)).values, preset(name)(mesh).values
    np.testing.assert_allclose(among[kept], alone, rtol=1e-4, atol=1e-6 * np.abs(alone).max())
    assert np.isfinite(among).all()
