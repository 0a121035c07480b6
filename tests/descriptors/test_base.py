from __future__ import annotations

import json
import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
import trimesh

from csm.descriptors import (
    ACD,
    DEP,
    GPS,
    HKS,
    SHOT,
    SMWD,
    WEDS,
    WKS,
    Descriptor,
    Features,
    Stack,
    from_parameters,
    preset,
)
from csm.descriptors.base import as_operators, record
from csm.errors import ConfigError, CsmError
from csm.mesh.io import write_mesh
from csm.operators import Operators
from tests.shapes import blob, rotation

SMALL = [
    preset("acd_paper", angles=4),
    preset("acd_paper", alpha=4.0, angles=3, k=30, order=5, normalise=True),
    preset("acd_isotropic", k=20),
    ACD(angles=3),
    HKS(k=40, n_times=10),
    WKS(k=40, n_energies=30),
    WKS(k=40, n_energies=40, variant="functional_map"),
]

each = pytest.mark.parametrize("descriptor", SMALL, ids=repr)


@each
def test_rows_columns_and_plain_parameters(descriptor):
    mesh = blob(2)
    features = descriptor(mesh)
    assert features.values.shape == (mesh.n_vertices, len(features.columns))
    assert len(set(features.columns)) == len(features.columns)
    assert np.isfinite(features.values).all()
    assert isinstance(descriptor, Descriptor)
    assert from_parameters(**json.loads(json.dumps(record(descriptor)))) == descriptor


@each
def test_rigid_motion_changes_nothing(descriptor):
    mesh = blob(3)
    moved = replace(mesh, vertices=mesh.vertices @ rotation(5).T + np.array([1.0, 2.0, 3.0]))
    before = descriptor(mesh).values
    np.testing.assert_allclose(descriptor(moved).values, before, atol=1e-6 * np.abs(before).max())


@each
def test_scale_changes_nothing_at_unit_area_and_only_a_factor_without(descriptor):
    mesh = blob(3)
    big = replace(mesh, vertices=3.0 * mesh.vertices)
    before = descriptor(mesh).values
    np.testing.assert_allclose(descriptor(big).values, before, atol=1e-6 * np.abs(before).max())
    if isinstance(descriptor, WKS):
        return  # its bounds are logarithms: "/ 1.02" and the clamp at 1e-6 have a unit
    raw, raw_big = (descriptor(Operators(m, unit_area=False)).values for m in (mesh, big))
    factor = np.abs(raw_big).max() / np.abs(raw).max()
    np.testing.assert_allclose(raw_big, factor * raw, atol=1e-6 * np.abs(raw_big).max())


@each
def test_numbering_of_vertices_only_reorders_the_rows(descriptor):
    mesh = blob(3)
    new_of_old = np.random.default_rng(0).permutation(mesh.n_vertices)
    vertices = np.empty_like(mesh.vertices)
    vertices[new_of_old] = mesh.vertices
    before, after = (
        descriptor(mesh).values,
        descriptor(replace(mesh, vertices=vertices, faces=new_of_old[mesh.faces])).values,
    )
    np.testing.assert_allclose(after[new_of_old], before, atol=1e-6 * np.abs(before).max())


@each
def test_signs_of_eigenvectors_change_nothing(descriptor, monkeypatch):
    mesh = blob(2)
    before = descriptor(mesh).values
    honest = Operators._spectrum

    def flipped(self, *args):
        found = honest(self, *args)
        return replace(found, evecs=found.evecs * np.where(np.arange(found.evecs.shape[1]) % 2, -1.0, 1.0))

    monkeypatch.setattr(Operators, "_spectrum", flipped)
    np.testing.assert_array_equal(descriptor(mesh).values, before)


def test_operators_are_used_as_they_are():
    operators = Operators(blob(2), unit_area=False)
    assert as_operators(operators) is operators
    assert as_operators(blob(2)).mesh.area == pytest.approx(1)


ASKING = [
    ACD(angles=4),
    HKS(k=40),
    SMWD(k=20),
    WEDS(k=50),
    GPS(k=7),
    SHOT(),
    DEP(n_scales=1),
    DEP(n_scales=1, distance="biharmonic", k=20),
    Stack({"a": GPS(k=7), "b": HKS(k=9)}),
]


@pytest.mark.parametrize("descriptor", ASKING, ids=repr)
def test_a_descriptor_says_how_many_eigenpairs_it_asks_for(descriptor, monkeypatch):
    asked = [0]
    solve = Operators._solve
    monkeypatch.setattr(
        Operators, "_solve", lambda self, matrix, k, **hint: asked.append(k) or solve(self, matrix, k, **hint)
    )
    descriptor(blob(3))
    assert max(asked) == descriptor.eigenpairs


@dataclass(frozen=True)
class Heights(Descriptor):
    """A family as somebody would add it: its second formula, with a parameter that the first release had not."""

    k: int = 3
    factor: float = 2.0

    name: ClassVar[str] = "heights"
    version: ClassVar[int] = 2
    added: ClassVar[dict[str, Any]] = {"factor": 1.0}

    def evaluate(self, operators):
        return Features(self.factor * operators.mesh.vertices[:, 2:], ("z",))


def test_a_family_states_its_fields_and_gets_the_rest():
    assert Heights().parameters() == {"k": 3, "factor": 2.0}
    assert Heights(factor=1.0).parameters() == {"k": 3}, "keys from before there was a factor stay"
    assert record(Heights(factor=1.0)) == {"name": "heights", "k": 3, "version": 2}
    assert record(HKS(k=40)) == {"name": "hks", "k": 40, "n_times": 100, "scaled": True}, "without the first version"
    assert (Heights(k=7).eigenpairs, SHOT().eigenpairs, GPS(k=7).eigenpairs) == (7, 0, 8)


@pytest.mark.parametrize(
    ("name", "wrong", "wanted"),
    [
        ("hks", {"k": "3"}, "hks: k='3'; wanted a whole number"),
        ("wks", {"n_energies": 2.5}, "wks: n_energies=2.5; wanted a whole number"),
        ("acd", {"k": True}, "acd: k=True; wanted a whole number"),
        ("acd", {"alpha": None}, "acd: alpha=None; wanted a finite number"),
        ("acd", {"alpha": float("inf")}, "acd: alpha=inf; wanted a finite number"),
        ("lps", {"radii": 3}, "lps: radii=3; wanted a list of finite numbers"),
        ("awft", {"functions": "fiedler"}, "awft: functions='fiedler'; wanted a list of names"),
        ("wft", {"functions": [1, 2]}, "wft: functions=[1, 2]; wanted a list of names"),
        ("acd", {"frame": "smoth"}, "acd: frame='smoth'; wanted one of line_field, smooth, released"),
        ("acd", {"frame": 3}, "acd: frame=3; wanted one of line_field"),
        ("wft", {"normalise": "columns"}, "wft: normalise='columns'; wanted one of vertices, area"),
        ("wks", {"variant": "x"}, "wks: variant='x'; wanted one of aubry, functional_map"),
        ("lps", {"radii": ["a"]}, "lps: radii=['a']; wanted a list of finite numbers"),
        ("acd_two_bands", {"parts": {"a": 3}}, "stack: parts={'a': 3}; wanted descriptors by name"),
        ("acd", {"normalise": "yes"}, "acd: normalise='yes'; wanted true or false"),
        ("acd", {"angles": 0}, "acd: angles=0; wanted 1 or more"),
        ("wks", {"variant": "functional_map", "n_energies": 28}, "wks: n_energies=28; wanted 29 or more"),
        ("dep", {"smallest": 0.5, "largest": 0.4}, "dep: smallest=0.5; wanted a number above 0, up to largest=0.4"),
        ("hks", {"first": 3.0}, "hks: first=3.0; wanted two times with 0 < first < last, or none of both; last=None"),
    ],
)
def test_a_wrong_parameter_is_refused_with_what_was_wanted(name, wrong, wanted):
    with pytest.raises(ConfigError, match=re.escape(wanted)):
        preset(name, **wrong)


def test_parameters_may_be_numbers_of_numpy_and_none_where_the_family_says_so():
    assert json.loads(json.dumps(preset("hks", k=np.int64(20), first=None).parameters()))["k"] == 20
    assert json.loads(json.dumps(preset("acd", alpha=np.float32(5)).parameters()))["alpha"] == 5
    assert type(preset("acd", alpha=5).alpha) is int


def test_a_family_that_cannot_be_evaluated_is_none():
    class Nothing(Descriptor):
        name = "nothing"

    with pytest.raises(TypeError, match="evaluate"):
        Nothing()


@pytest.mark.parametrize(
    ("shape", "came"),
    [
        ("tr_reg_000.off", r"tr_reg_000\.off: there is no such file"),
        (Path("a/b.off"), r"a.b\.off: there is no such file"),
        (np.zeros((5, 3)), r"csm\.read_mesh.* got an array of shape \(5, 3\)"),
        (None, r"csm\.read_mesh.* got a NoneType"),
    ],
)
@pytest.mark.parametrize("descriptor", [HKS(), ACD(), SHOT(), Stack({"a": WKS()})], ids=lambda each: each.name)
def test_what_is_no_shape_is_refused_by_name(descriptor, shape, came):
    with pytest.raises(CsmError, match=came):
        descriptor(shape)


def test_a_descriptor_takes_every_kind_of_mesh(tmp_path):
    mesh = blob(2)
    write_mesh(tmp_path / "a.off", mesh)
    wanted = HKS(k=20)(mesh).values
    other = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    for given in (str(tmp_path / "a.off"), tmp_path / "a.off", (mesh.vertices, mesh.faces), other):
        np.testing.assert_array_equal(HKS(k=20)(given), wanted)


def features(q: int = 3) -> Features:
    return Features(np.arange(4.0 * q).reshape(4, q), tuple("abc"[:q]))


def test_features_are_an_array_to_numpy():
    found = features()
    assert np.asarray(found) is found.values
    assert (len(found), found.shape, np.shape(found)) == (4, (4, 3), (4, 3))
    np.testing.assert_array_equal(np.linalg.norm(found, axis=1), np.linalg.norm(found.values, axis=1))
    single = np.asarray(found, dtype=np.float32)
    assert single.dtype == np.float32
    np.testing.assert_array_equal(single, found.values)
    copied = np.array(found)
    assert not np.shares_memory(copied, found.values)
    np.testing.assert_array_equal(copied, found.values)


def test_features_keep_the_rules_of_numpy_for_copies():
    found = features()
    assert found.__array__() is found.values
    assert found.__array__(np.float64, copy=False) is found.values
    assert not np.shares_memory(found.__array__(copy=True), found.values)
    assert found.__array__(np.float32, copy=True).dtype == np.float32
    with pytest.raises(ValueError, match="only as a copy"):
        found.__array__(np.float32, copy=False)


def test_features_are_shown_in_one_line():
    assert repr(features()) == "Features(4 vertices, 3 columns: a ... c)"
    assert repr(features(1)) == "Features(4 vertices, 1 column: a)"
