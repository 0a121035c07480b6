"""Pairs one by one: the worst come first, and what is shown of them is what was measured."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from csm.evaluation import EvaluationProtocol
from csm.experiments.pairs import (
    common_view,
    pair_viewer,
    pairs_table,
    spread,
    vertex_errors,
    view_of_most,
    worst_first,
    worst_line,
    worst_viewers,
    write_pairs,
)
from csm.experiments.testing import measure_set
from csm.learning.loading import LightningData
from csm.matching.nearest import nearest
from csm.matching.network import NetworkMethod
from csm.mesh.shape import Mesh
from csm.operators.geodesic import geodesics
from tests.learning.toys import make
from tests.shapes import sphere
from tests.toyset import toy_datamodule

if TYPE_CHECKING:
    from csm.experiments.testing import Tested

PROTOCOL = EvaluationProtocol(points=40, distance="edge", normaliser="sqrt_area")


@pytest.fixture(scope="module")
def tested(tmp_path_factory: pytest.TempPathFactory) -> Tested:
    data = toy_datamodule(tmp_path_factory.mktemp("pairs"))
    module = make(LightningData(data), training={"name": "net", "set": "toys", "seed": 4, "epochs": 7})
    (found,) = measure_set(NetworkMethod(module), data, data.train_set, PROTOCOL)
    return found


def test_the_table_begins_with_the_worst_pair(tested: Tested) -> None:
    rows = worst_first(tested)
    assert len(rows) == len(tested.evaluation.rows) > 1
    assert rows[0].age == max(row.age for row in tested.evaluation.rows)
    table = pairs_table(tested)
    assert table.rows[0][:2] == (rows[0].source, rows[0].target)
    errors = [float(str(line[2])) for line in table.rows]
    assert errors == sorted(errors, reverse=True)
    assert errors[0] == pytest.approx(1000 * rows[0].age, abs=0.06)


def test_the_worst_pair_is_said_in_a_line(tested: Tested) -> None:
    worst = worst_first(tested)[0]
    said = worst_line(tested)
    assert said.startswith(
        f"worst of {len(tested.evaluation.rows)} pairs of toys: {worst.source} to {worst.target} with "
    )
    assert said.endswith(f"{1000 * worst.age:.1f} thousandths of the sqrt_area")


def test_errors_of_a_pair_are_heat_distances_at_every_vertex(tested: Tested) -> None:
    pair = tested.names
    source, target = (tested.shapes.load(name).mesh for name in pair)
    errors = vertex_errors(tested, pair, source.n_vertices)
    here, there = (tested.method.describe(mesh, tested.store).features for mesh in (source, target))
    rows = geodesics(target, "heat").rows(np.arange(162))
    expected = rows[np.arange(162), nearest(here, there)] / np.sqrt(target.area)
    np.testing.assert_allclose(errors, expected, atol=1e-9)


def test_errors_at_some_points_are_those_at_all_vertices(tested: Tested) -> None:
    pair, n = (tested.names[0], tested.names[1]), 162
    some, all_of_them = vertex_errors(tested, pair, n, points=30), vertex_errors(tested, pair, n)
    measured = np.isfinite(some)
    assert measured.sum() == 30
    np.testing.assert_allclose(some[measured], all_of_them[measured], atol=1e-9)


def test_a_shown_pair_is_the_one_that_was_matched(tested: Tested) -> None:
    row = worst_first(tested)[0]
    viewer = pair_viewer(tested, row, common_view(tested), "the worst pair")
    source, target = viewer.panels
    here, there = (tested.method.describe(p.mesh, tested.store) for p in viewer.panels)
    np.testing.assert_array_equal(source.to_reference, tested.matcher(here, there).indices)
    np.testing.assert_allclose(source.features, here.features)
    np.testing.assert_allclose(target.features, there.features)
    np.testing.assert_allclose(source.errors, vertex_errors(tested, (row.source, row.target), 162))
    assert set(viewer.scales) == {"confidence", "errors", "distance"}
    assert f"{row.source} to {row.target}, the worst pair" in viewer.caption


def test_viewers_and_the_page_show_the_worst_first(tested: Tested, tmp_path: Path) -> None:
    rows = worst_first(tested)
    viewers = worst_viewers(tested, 2, common_view(tested))
    assert [tuple(p.mesh.name for p in v.panels) for v in viewers] == [(r.source, r.target) for r in rows[:2]]
    write_pairs(tmp_path / "pairs.html", tested)
    page = (tmp_path / "pairs.html").read_text(encoding="utf-8")
    assert page.count('class="viewer"') == 1
    assert "net on toys" in page
    assert "the worst pair" in page


def test_values_are_spread_to_what_is_near_and_not_further() -> None:
    mesh = sphere(4)
    up = mesh.vertices[:, 2]
    some = np.where((up > 0) & (np.arange(mesh.n_vertices) % 4 == 0), up, np.nan)
    filled = spread(mesh, some)
    np.testing.assert_array_equal(filled[np.isfinite(some)], some[np.isfinite(some)])
    assert np.isfinite(filled[up > 0.1]).all()
    np.testing.assert_allclose(filled[up > 0.1], up[up > 0.1], atol=0.15)
    assert np.isnan(filled[up < -0.5]).all()
    nothing = np.full(mesh.n_vertices, np.nan)
    np.testing.assert_array_equal(spread(mesh, nothing), nothing)


def test_one_shape_with_its_arms_spread_wide_lies_down_alone() -> None:
    ball = sphere(1)
    tall, wide = (Mesh(ball.vertices * scale, ball.faces) for scale in ((1, 1, 3), (4, 1, 3)))
    assert view_of_most([wide, tall, tall]) == view_of_most([tall])
    assert view_of_most([wide]) != view_of_most([tall])
