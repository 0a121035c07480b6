from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

from csm.data.store import Store
from csm.errors import ConfigError
from csm.mesh.io import write_mesh
from csm.studies import table2
from csm.studies.study import Context
from csm.studies.table2 import exponent, run, timed_mesh, times_figure
from csm.studies.timing import Timed
from tests.data.layouts import patch
from tests.shapes import blob


@pytest.fixture
def context(tmp_path) -> Context:
    return Context(tmp_path / "data", tmp_path / "out", Store(tmp_path / "store"))


@pytest.fixture
def asked(monkeypatch) -> list[tuple[int, str, int]]:
    """Make times that grow with the square of the vertices, and meshes that cost nothing."""
    asked: list[tuple[int, str, int]] = []

    def fake(mesh, parameters, threads, repeats):
        asked.append((mesh.n_vertices, parameters["name"], threads))
        seconds = {"acd": 1.0, "hks": 3.0}[parameters["name"]] * (mesh.n_vertices / 1000) ** 2 / threads
        return Timed((seconds,) * repeats, (seconds,) * repeats)

    monkeypatch.setattr(table2, "time_descriptor", fake)
    monkeypatch.setattr(table2, "timed_mesh", lambda _r, _s, size, _seed: (patch(size), "a fan"))
    return asked


def test_rows_have_seconds_exponents_and_ratios(context, asked):
    findings = run(context, sizes=[2000, 1000], descriptors=["acd_paper", "hks"], threads=[2, 1])
    assert [(row["descriptor"], row["threads"]) for row in findings.rows] == [
        ("acd_paper", 1),
        ("hks", 1),
        ("acd_paper", 2),
        ("hks", 2),
    ]
    row = findings.rows[1]
    assert (row["1000"], row["2000"]) == (3.0, 12.0)
    assert row["exponent"] == pytest.approx(2)
    assert (row["to acd"], row["paper to acd"]) == (3.0, None)
    assert findings.rows[0]["paper to acd"] == 1
    assert findings.columns[2:4] == ("1000", "2000")
    assert "1000: a fan (1000 vertices)" in " ".join(findings.notes)
    assert Image.open(findings.pictures[0]).width > 500


def test_cells_are_kept_and_made_again_for_another_question(context, asked, caplog):
    options = {"sizes": [1000], "descriptors": ["acd_paper", "hks"], "threads": [1]}
    first = run(context, **options)
    assert run(context, **options).markdown() == first.markdown()
    assert len(asked) == 2
    run(context, **options, repeats=1)
    assert len(asked) == 4
    assert "another question" in caplog.text


def test_a_busy_machine_is_noted(context, asked, monkeypatch):
    monkeypatch.setattr(table2, "time_descriptor", lambda *_: Timed((2.0,), (1.0,)))
    findings = run(context, sizes=[1000], descriptors=["hks"], threads=[1])
    assert "1 of 1 cells" in findings.notes[-1]
    assert findings.rows[0]["exponent"] is None
    assert findings.rows[0]["to acd"] is None


def test_it_runs_for_real_on_a_small_mesh(context, monkeypatch):
    monkeypatch.setattr(table2, "timed_mesh", lambda *_: (blob(2), "a blob"))
    (row,) = run(context, sizes=[162], descriptors=["acd_paper"], threads=[1], repeats=2).rows
    assert len(row["measurements"]["162"]["wall"]) == 2


@pytest.mark.parametrize(
    "options", [{"sizes": []}, {"threads": []}, {"descriptors": []}, {"repeats": 0}, {"sizes": [0]}, {"threads": [0]}]
)
def test_wrong_options_are_refused(context, options):
    with pytest.raises(ConfigError):
        run(context, **options)


def test_published_meshes_are_taken_and_others_made_and_kept(tmp_path):
    root, store = tmp_path / "data", Store(tmp_path / "store")
    write_mesh(root / "FAUST_8000" / "tr_reg_000.off", patch(8000))
    mesh, whence = timed_mesh(root, store, 8000)
    assert (mesh.n_vertices, whence) == (8000, "FAUST_8000/tr_reg_000")
    mesh, whence = timed_mesh(root, store, 7000)
    assert (mesh.n_vertices, whence) == (7000, "built-in human s00_p00, refined")
    again, _ = timed_mesh(root, store, 7000)
    assert (again.digest, store.computed) == (mesh.digest, 1)


def test_the_exponent_is_the_slope_in_logarithms():
    sizes = np.array([1000, 3000, 9000])
    assert exponent(sizes, 0.01 * sizes**1.3) == pytest.approx(1.3)
    assert exponent([1000], [1.0]) is None


def test_the_picture_has_logarithmic_axes_and_a_tick_per_size():
    figure = times_figure({"a": {1000: 1.0, 2000: 4.0}, "b": {1000: 2.0}})
    (axes,) = figure.axes
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
    assert [text.get_text() for text in axes.get_xticklabels()] == ["1,000", "2,000"]
    assert [line.get_label() for line in axes.get_lines()] == [r"a $\sim N^{2.0}$", "b"]
