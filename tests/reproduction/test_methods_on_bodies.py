from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import lightning as L
import numpy as np
import pytest
import torch

from csm.data.shapes import Shape
from csm.data.store import Store
from csm.descriptors import preset
from csm.descriptors.base import record
from csm.errors import ConfigError, DataError, MeshError
from csm.learning.module import CSMModule
from csm.matching.base import Described
from csm.matching.methods import Method, PrecomputedMethod
from csm.mesh.correspondence import Direction, PointMap
from csm.mesh.perturb import with_noise
from csm.reproduction import methods_on_bodies
from csm.reproduction.methods_on_bodies import (
    NEAR,
    Figure10,
    Figure12,
    Figure13,
    by_method,
    cut_extremity,
    filled,
    trained_on,
)
from csm.reproduction.study import Findings
from tests.reproduction.toys import Toys, measure_no_more, toy_bodies, toy_context
from tests.shapes import blob

SMALL = {"descriptors": ("acd_isotropic",), "n_pairs": 2, "points": 40, "distance": "edge"}


def figure10(folder: Path, **options: object) -> Findings:
    return Figure10("figure10", source=toy_bodies(), **options).run(toy_context(folder))  # type: ignore[arg-type]


def figure12(folder: Path, **options: object) -> Findings:
    return Figure12("figure12", source=toy_bodies(), **SMALL | options).run(toy_context(folder))


def figure13(folder: Path, **options: object) -> Findings:
    return Figure13("figure13", source=toy_bodies(), **SMALL | {"fractions": (0.2,)} | options).run(toy_context(folder))


def save_network(path: Path, name: str) -> Path:
    """Write the checkpoint of a network that was trained on the set of this name."""
    torch.manual_seed(0)
    network = {"name": "csmcnn", "ks": 16, "channels": [8, 8], "terms": 2}
    module = CSMModule(network, 7, 162, record(preset("acd_isotropic")), basis_k=16, training={"set": name})
    trainer = L.Trainer(logger=False, enable_checkpointing=False, enable_progress_bar=False, max_epochs=0)
    trainer.strategy.connect(module)
    trainer.save_checkpoint(path)
    return path


def test_networks_of_the_learned_tables_are_found_if_they_know_the_bodies(tmp_path):
    rows = {"toys_mgcn": "toys_162", "toys_paper": "toys_162", "scape_mgcn": "SCAPE_5000", "ks_64": "toys_162"}
    for row, name in rows.items():
        save_network(tmp_path / "out" / "cells" / row / "seed0" / "model.ckpt", name)
    save_network(tmp_path / "out" / "cells" / "toys_paper" / "seed1" / "model.ckpt", "toys_162")
    assert [method.name for method in trained_on("toys_162", tmp_path / "out")] == ["MGCN", "CSMCNN"]
    study = Figure12("figure12", descriptors=("acd_isotropic",))
    found = study.methods(toy_context(tmp_path), toy_bodies())
    assert [method.name for method in found] == ["ACD isotropic", "MGCN", "CSMCNN"]


def test_a_trained_network_is_a_method_like_any_other(tmp_path):
    path = save_network(tmp_path / "net.ckpt", "elsewhere")
    found = figure12(tmp_path, checkpoints={"net": str(path)}, strengths=(0.0,))
    assert [row["method"] for row in found.rows] == ["ACD isotropic", "net"]
    assert found.rows[1]["cells"][0]["error"] > 0


def test_nothing_to_compare_is_an_error(tmp_path):
    context, bodies = toy_context(tmp_path), toy_bodies()
    with pytest.raises(ConfigError, match="checkpoint"):
        Figure12("figure12", descriptors=()).methods(context, bodies)
    with pytest.raises(DataError, match="no such checkpoint"):
        Figure12("figure12", checkpoints={"x": str(tmp_path / "x.ckpt")}).methods(context, bodies)
    assert not Store(tmp_path / "store").root.exists()


def test_every_method_has_a_row_per_triangulation_and_a_picture(tmp_path):
    found = figure10(tmp_path, descriptors=("acd_isotropic", "smwd"), size=(60, 80))
    assert [(row["method"], row["mesh"]) for row in found.rows] == [
        ("ACD isotropic", "162 vertices"),
        ("ACD isotropic", "300 vertices"),
        ("SMWD", "162 vertices"),
        ("SMWD", "300 vertices"),
    ]
    assert found.pictures[0].is_file()
    with pytest.raises(ConfigError, match="high"):
        figure10(tmp_path, high=0)


def test_errors_are_drawn_at_the_vertices_that_were_matched(tmp_path, monkeypatch):
    drawn = {}
    draw = methods_on_bodies.scalar_grid
    monkeypatch.setattr(
        methods_on_bodies, "scalar_grid", lambda grid, *a, **k: drawn.update(grid) or draw(grid, *a, **k)
    )
    monkeypatch.setattr(methods_on_bodies, "filled", lambda mesh, values: values)
    numbers = {name: torch.arange(300)[:, None].float() for name in ("toy0", "toy2")}
    methods = [PrecomputedMethod(numbers, "numbers"), PrecomputedMethod({n: 0 * x for n, x in numbers.items()}, "one")]
    monkeypatch.setattr(Figure10, "methods", lambda *_: methods)
    bodies = replace(toy_bodies(), original=toy_bodies().others["300 vertices"], others={})
    found = Figure10("figure10", source=bodies, size=(40, 50)).run(toy_context(tmp_path))
    for name, exact in (("numbers", 162), ("one", 1)):
        (panel,) = drawn[name]
        assert np.isfinite(panel.values[:162]).all()
        assert np.isnan(panel.values[162:]).all()
        assert (panel.values[:162] == 0).sum() == exact
    assert [row["exact %"] for row in found.rows] == pytest.approx([100, 100 / 162])


def test_a_vertex_counts_once_although_several_points_of_the_template_lie_on_it(tmp_path, monkeypatch):
    @dataclass(frozen=True)
    class Crowded(Toys):
        """The toys, with 60 more points of the template on the first vertex."""

        def load(self, name):
            mesh = super().load(name).mesh
            indices = np.concatenate([np.arange(162), np.zeros(60, dtype=int)])
            return Shape(mesh, PointMap(indices, Direction.TEMPLATE_TO_SHAPE, 162))

    constant = {name: torch.zeros(162, 1) for name in ("toy0", "toy2")}
    monkeypatch.setattr(Figure10, "methods", lambda *_: [PrecomputedMethod(constant, "first vertex everywhere")])
    bodies = replace(toy_bodies(), original=Crowded(), others={})
    found = Figure10("figure10", source=bodies, size=(40, 50)).run(toy_context(tmp_path))
    assert found.rows[0]["exact %"] == pytest.approx(100 / 162)


def test_a_picture_takes_errors_over_to_near_vertices_only():
    mesh = blob(3).unit_area()
    values = np.full(mesh.n_vertices, np.nan)
    values[0] = 0.5
    distances = np.linalg.norm(mesh.vertices - mesh.vertices[0], axis=1)
    drawn = filled(mesh, values)
    assert (distances <= NEAR).sum() > 1
    np.testing.assert_array_equal(drawn[distances <= NEAR], 0.5)
    assert np.isnan(drawn[distances > NEAR]).all()


def test_errors_grow_with_the_noise_and_there_is_a_picture(tmp_path):
    found = figure12(tmp_path, strengths=(1.0, 0.0, 0.2))
    (line,) = found.rows
    assert found.columns == ("method", "0", "0.2", "1")
    assert [row["damage"] for row in line["cells"]] == ["0", "0.2", "1"]
    none, _, most = (row["error"] for row in line["cells"])
    assert line["1"].startswith(f"{most:.1f} ± ")
    assert most > none + 20
    assert found.pictures[0].is_file()


def test_what_was_measured_is_kept_for_its_question_only(tmp_path, monkeypatch):
    first = figure12(tmp_path, strengths=(0.0, 0.5))
    measure_no_more(monkeypatch)
    assert figure12(tmp_path, strengths=(0.0, 0.5)).rows == first.rows
    with pytest.raises(pytest.fail.Exception):
        figure12(tmp_path, strengths=(0.0,), points=41)
    monkeypatch.undo()
    more = figure12(tmp_path, strengths=(0.0, 0.5, 0.9))
    assert more.rows[0]["cells"][:2] == first.rows[0]["cells"]
    assert figure12(tmp_path / "alone", strengths=(0.0, 0.5, 0.9)).rows == more.rows


def test_every_damage_has_its_row_and_what_it_leaves(tmp_path, monkeypatch):
    monkeypatch.setattr(methods_on_bodies, "grown_together", _too_round)
    found = figure13(tmp_path)
    (line,) = found.rows
    none, cut, grown = line["cells"]
    assert found.columns == ("method", "none", "20 % cut away", "grown together")
    assert "grown together" not in line
    assert (none["vertices left"], none["damage"]) == (1, "none")
    assert 0.6 < cut["vertices left"] < 0.95
    assert cut["error"] > none["error"]
    assert (grown["error"], grown["failed"]) == (None, "nothing touches")
    assert "ACD isotropic, grown together: nothing touches" in found.notes
    assert found.pictures[0].is_file()


def _too_round(mesh):
    raise MeshError("nothing touches")


def test_a_perfect_descriptor_has_no_error_whatever_is_cut_away(tmp_path, monkeypatch):
    """Errors are measured on the whole target."""
    bodies = toy_bodies()
    known = {}
    for name in bodies.original.names:
        for i, row in enumerate(bodies.original.load(name).mesh.vertices.tolist()):
            known[tuple(row)] = i

    class Oracle(Method):
        name, key, recipe = "oracle", {"oracle": 1}, None  # type: ignore[assignment]

        def describe(self, mesh, store, device="cpu"):
            return Described(mesh, torch.tensor([[float(known[tuple(row)])] for row in mesh.vertices.tolist()]))

    study = Figure12("figure12", **SMALL)
    monkeypatch.setattr(Figure12, "methods", lambda *_: [Oracle()])
    (row,) = study.rows(toy_context(tmp_path), bodies, {"cut": lambda mesh: cut_extremity(mesh, 0.15)})
    assert (row["error"], row["exact %"]) == (0, 100)
    assert row["vertices left"] < 0.95


def test_the_last_twenty_bodies_are_tested_and_pairs_drawn_among_them(tmp_path, monkeypatch):
    asked = {}
    names = tuple(f"body{i}" for i in range(30))
    monkeypatch.setattr(Figure12, "methods", lambda *_: ["hks"])
    monkeypatch.setattr(Figure12, "evaluate", lambda self, *a, **k: asked.update(pairs=a[3]) or [])
    bodies = replace(toy_bodies(), original=replace(toy_bodies().original, names=names))
    Figure12("figure12", n_pairs=50).rows(toy_context(tmp_path), bodies, {"none": with_noise})
    assert len(set(asked["pairs"])) == 50
    assert {name for pair in asked["pairs"] for name in pair} <= set(names[10:])


def test_the_extremity_is_what_is_farthest_from_the_middle():
    mesh = blob(3)
    left = cut_extremity(mesh, 0.1)
    gone = np.setdiff1d(np.arange(mesh.n_vertices), left.kept)
    middle = mesh.face_areas @ mesh.corners.mean(axis=1) / mesh.area
    assert np.linalg.norm(mesh.vertices - middle, axis=1).argmax() in gone


def test_a_single_target_has_no_standard_error():
    rows = [{"method": "m", "damage": "d", "error": 5.25, "standard error": None}]
    assert by_method(rows) == [{"method": "m", "cells": rows, "d": "5.2"}]


@pytest.mark.parametrize("wrong", [{"strengths": ()}, {"strengths": (-1.0,)}, {"descriptors": ()}, {"n_pairs": 0}])
def test_wrong_options_of_the_noise_are_refused(tmp_path, wrong):
    with pytest.raises(ConfigError):
        figure12(tmp_path, **wrong)


@pytest.mark.parametrize("wrong", [{"fractions": (0.0,)}, {"fractions": (1.0,)}, {"descriptors": ()}, {"points": 0}])
def test_wrong_options_of_the_damage_are_refused(tmp_path, wrong):
    with pytest.raises(ConfigError):
        figure13(tmp_path, **wrong)
