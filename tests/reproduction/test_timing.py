from __future__ import annotations

import contextlib
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from csm._types import Arrays
from csm.descriptors import preset
from csm.descriptors.base import record
from csm.errors import ConfigError
from csm.mesh.io import write_mesh
from csm.reproduction import timing
from csm.reproduction.study import Context, Findings
from csm.reproduction.timing import Table2, clocked, exponent, measured, time_descriptor, timed_mesh, times_figure
from tests.data.layouts import patch
from tests.reproduction.toys import toy_context
from tests.shapes import blob


@pytest.fixture
def context(tmp_path) -> Context:
    return toy_context(tmp_path)


def run(context: Context, **options: object) -> Findings:
    return Table2("table2", **options).run(context)  # type: ignore[arg-type]


def took(wall: list[float], cpu: list[float]) -> Arrays:
    return {"wall": np.array(wall), "cpu": np.array(cpu)}


@pytest.fixture
def asked(monkeypatch) -> list[tuple[int, str, int]]:
    """Make times that grow with the square of the vertices, and meshes that cost nothing."""
    asked: list[tuple[int, str, int]] = []

    def fake(mesh, parameters, threads, repeats):
        asked.append((mesh.n_vertices, parameters["name"], threads))
        seconds = {"acd": 1.0, "hks": 3.0}[parameters["name"]] * (mesh.n_vertices / 1000) ** 2 / threads
        return took([seconds] * repeats, [seconds] * repeats)

    monkeypatch.setattr(timing, "time_descriptor", fake)
    monkeypatch.setattr(timing, "timed_mesh", lambda _, size: (patch(size), "a fan"))
    return asked


def test_rows_have_seconds_exponents_and_ratios(context, asked):
    findings = run(context, sizes=(2000, 1000), descriptors=("acd_paper", "hks"), threads=(2, 1))
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
    assert row["measurements"]["1000"] == {"wall": [3.0] * 3, "cpu": [3.0] * 3}
    assert findings.rows[0]["paper to acd"] == 1
    assert findings.columns[2:4] == ("1000", "2000")
    assert "1000: a fan (1000 vertices)" in " ".join(findings.notes)
    assert Image.open(findings.pictures[0]).width > 500


def test_cells_are_kept_and_made_again_for_another_question(context, asked):
    options = {"sizes": (1000,), "descriptors": ("acd_paper", "hks"), "threads": (1,)}
    first = run(context, **options)
    assert run(context, **options).markdown() == first.markdown()
    assert len(asked) == 2
    run(context, **options, repeats=1)
    assert len(asked) == 4
    assert run(context, **options).markdown() == first.markdown()
    assert len(asked) == 4


def test_a_busy_machine_is_noted(context, asked, monkeypatch):
    monkeypatch.setattr(timing, "time_descriptor", lambda *_: took([2.0, 9.0, 2.0], [1.0, 9.0, 1.0]))
    findings = run(context, sizes=(1000,), descriptors=("hks",), threads=(1,))
    assert "1 of 1 cells" in findings.notes[-1]
    assert findings.rows[0]["1000"] == 2  # the median
    assert findings.rows[0]["exponent"] is None
    assert findings.rows[0]["to acd"] is None


@pytest.mark.long
def test_it_runs_for_real_on_a_small_mesh(context, monkeypatch):
    monkeypatch.setattr(timing, "timed_mesh", lambda *_: (blob(2), "a blob"))
    (row,) = run(context, sizes=(162,), descriptors=("acd_paper",), threads=(1,), repeats=2).rows
    assert len(row["measurements"]["162"]["wall"]) == 2


@pytest.mark.parametrize(
    "options", [{"sizes": ()}, {"threads": ()}, {"descriptors": ()}, {"repeats": 0}, {"sizes": (0,)}, {"threads": (0,)}]
)
def test_wrong_options_are_refused(context, options):
    with pytest.raises(ConfigError, match="wanted counts from 1"):
        run(context, **options)


def test_published_meshes_are_taken_and_others_made_and_kept(context):
    write_mesh(context.root / "FAUST_8000" / "tr_reg_000.off", patch(8000))
    mesh, whence = timed_mesh(context, 8000)
    assert (mesh.n_vertices, whence) == (8000, "FAUST_8000/tr_reg_000")
    mesh, whence = timed_mesh(context, 7000)
    assert (mesh.n_vertices, whence) == (7000, "built-in human s00_p00, refined")
    again, _ = timed_mesh(context, 7000)
    assert (again.digest, context.store.computed) == (mesh.digest, 1)


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


def test_the_clock_runs_once_per_input():
    seen: list[int] = []
    times = clocked(seen.append, range(3))
    assert seen == [0, 1, 2]
    assert times["wall"].shape == times["cpu"].shape == (3,)
    assert (times["wall"] >= 0).all()


def test_an_answer_is_measured_once_on_each_machine(context, monkeypatch):
    made = []

    def measure() -> Arrays:
        made.append(1)
        return took([1.5], [2.0])

    first = measured(context, "speed", blob(1), {"repeats": 1}, measure)
    assert measured(context, "speed", blob(1), {"repeats": 1}, measure)["wall"] == first["wall"] == [1.5]
    assert len(made) == 1
    measured(context, "speed", blob(1), {"repeats": 2}, measure)
    measured(context, "speed", blob(2), {"repeats": 1}, measure)
    monkeypatch.setattr(timing.os, "cpu_count", lambda: 1000)
    measured(context, "speed", blob(1), {"repeats": 1}, measure)
    assert len(made) == 4


def test_what_fails_is_not_kept(context):
    with pytest.raises(RuntimeError):
        measured(context, "speed", blob(1), {}, lambda: (_ for _ in ()).throw(RuntimeError("no")))
    assert measured(context, "speed", blob(1), {}, lambda: took([1.0], [1.0]))["wall"] == [1.0]


def test_a_descriptor_is_timed_in_another_process_as_often_as_asked():
    times = time_descriptor(blob(3), record(preset("acd_paper", angles=2)), threads=1, repeats=2)
    assert times["wall"].shape == times["cpu"].shape == (2,)
    assert 0.001 < np.median(times["wall"]) < 60


def test_every_repeat_is_cold_and_keeps_to_its_threads(monkeypatch):
    asked, solved = [], []
    honest = timing.Operators
    monkeypatch.setattr(timing, "threadpool_limits", lambda n: asked.append(n) or contextlib.nullcontext())
    monkeypatch.setattr(timing, "Operators", lambda mesh: solved.append(mesh) or honest(mesh))
    mesh = blob(2)
    timing._timed(mesh.vertices, mesh.faces, record(preset("hks", k=20)), threads=2, repeats=3)
    assert asked == [2]
    assert len({id(m) for m in solved}) == 4  # one of them to warm up


def test_wrong_parameters_are_refused_in_the_caller_too():
    with pytest.raises(ConfigError, match="nothing"):
        timing._timed(blob(1).vertices, blob(1).faces, {"name": "nothing"}, 1, 1)


@pytest.mark.data
def test_faust_is_the_body_where_it_is(data_set, context):
    context = replace(context, root=data_set("FAUST_6890"))
    mesh, whence = timed_mesh(context, 6890)
    assert (mesh.n_vertices, whence) == (6890, "FAUST_6890/tr_reg_000")
