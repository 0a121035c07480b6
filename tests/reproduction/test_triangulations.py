from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from csm.errors import ConfigError, DataError
from csm.mesh.remesh import remesh
from csm.reproduction.triangulations import PERFECT, Triangulations, on_template
from tests.reproduction.toys import Toys, toy_bodies, toy_context


def study(folder, **options):
    options = {"forms": ("slivers_20", "remeshed_150"), "points": 60, "n_bodies": 3, "checkpoints": {}} | options
    return Triangulations("triangulations", source=toy_bodies(), **options).run(toy_context(folder))


def test_a_perfect_map_errs_only_where_vertices_are_other_ones(tmp_path):
    found = study(tmp_path, descriptors=("acd_isotropic",))
    errors = {(row["triangulation"], row["method"]): row["error"] for row in found.rows}
    assert errors["original", PERFECT] == errors["slivers_20", PERFECT] == 0
    assert 0 < errors["remeshed_150", PERFECT] < 60
    (other,) = {method for _, method in errors} - {PERFECT}
    assert errors["remeshed_150", other] > errors["remeshed_150", PERFECT]
    assert found.pictures[0].is_file()


def test_places_are_those_of_the_same_points(tmp_path):
    """Vertices that are remeshed from another body lie where its own would, carried over."""
    bodies = Toys()
    body = bodies.load("toy1").mesh
    np.testing.assert_allclose(on_template(bodies, "toy1", body, "toy0"), bodies.load("toy0").mesh.vertices, atol=1e-12)
    other = remesh(body, 200).mesh
    np.testing.assert_allclose(on_template(bodies, "toy1", other, "toy1"), other.vertices, atol=1e-9)


@dataclass(frozen=True)
class Turned(Toys):
    """Its bodies have no faces in common."""

    def load(self, name):
        shape = super().load(name)
        by = self.names.index(name)
        return replace(shape, mesh=replace(shape.mesh, faces=np.roll(shape.mesh.faces, by, axis=1)))


def test_bodies_with_different_faces_and_too_few_are_refused(tmp_path):
    with pytest.raises(DataError, match="toy1 and toy0 have different faces"):
        on_template(Turned(), "toy1", Turned().load("toy1").mesh, "toy0")
    with pytest.raises(ConfigError, match="n_bodies=1; wanted at least 2"):
        study(tmp_path, n_bodies=1)
    with pytest.raises(ConfigError, match=r"triangulations\.forms: 'nope' is no form"):
        study(tmp_path, forms=("nope",))
