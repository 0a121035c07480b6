"""Figures say what their axes are, show the numbers they were given and are the same every time."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from csm.errors import ConfigError
from csm.evaluation.distances import Lengths, MatchedPoints, PointErrors
from csm.evaluation.protocol import EvaluationProtocol
from csm.evaluation.results import PairErrors, summarise
from csm.viewer import figures
from csm.viewer.camera import View
from csm.viewer.colors import position_colors, pull_colors
from csm.viewer.figures import (
    Curve,
    correspondence_figure,
    cqc_figure,
    figure_to_array,
    filters_figure,
    save_figure,
)
from csm.viewer.render import render
from tests.shapes import blob

T = np.linspace(0, 0.25, 11)
SMALL = (60, 80)


def legend(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.axes[0].get_legend().get_texts()]


def test_cqc_shows_every_method_with_its_mean_error() -> None:
    figure = cqc_figure({"ours": Curve(T, np.sqrt(T / 0.25), 0.0104), "theirs": (T, T / 0.25, 0.077)})
    axes = figure.axes[0]
    assert legend(figure) == ["ours (AGE 10.4)", "theirs (AGE 77.0)"]
    np.testing.assert_allclose(axes.get_lines()[1].get_ydata(), 100 * T / 0.25)
    assert "fraction of the geodesic diameter" in axes.get_xlabel()
    assert "%" in axes.get_ylabel()
    assert axes.get_xlim() == (0, 0.25)


def test_cqc_of_an_evaluation_takes_its_normaliser() -> None:
    points = np.arange(4)
    measured = PairErrors(
        ("a", "b"),
        MatchedPoints(points, points, points, np.ones(4, dtype=bool)),
        PointErrors(np.array([0.0, 0.2, 0.4, 0.2]), None, 0, 0.0),
        Lengths(diameter=4.0, sqrt_area=2.0),
    )
    result = summarise([measured], EvaluationProtocol(normaliser="sqrt_area"), 0.0, method="identity")
    figure = cqc_figure({"identity": result})
    assert "square root of the area" in figure.axes[0].get_xlabel()
    assert legend(figure) == ["identity (AGE 100.0)"]
    with pytest.raises(ConfigError, match="2 normalisers"):
        cqc_figure({"identity": result, "bare": Curve(T, T, 0.1)})


def test_filters_are_shown_by_bands_of_their_gains_and_the_strongest_by_name() -> None:
    evals = np.linspace(0, 100, 16)
    wide = np.random.default_rng(0).normal(size=(16, 3, 5))
    wide[:, 2, 4] *= 50
    figure = filters_figure(evals, {"conv1": wide, "conv2": wide[:, :1]})
    bands, few, strongest, all_five = figure.axes
    assert [a.get_title() for a in (bands, few)] == ["conv1: 15 filters", "conv2: 5 filters"]
    (median,) = bands.get_lines()
    np.testing.assert_allclose(median.get_ydata(), np.median(np.abs(wide), axis=(1, 2)))
    np.testing.assert_allclose(median.get_xdata(), evals / 100)
    assert [len(a.collections) for a in (bands, few)] == [2, 2]
    lines = [line for line in strongest.get_lines() if "→" in str(line.get_label())]
    assert (len(lines), lines[0].get_label()) == (12, "2 → 4")
    np.testing.assert_allclose(lines[0].get_ydata(), wide[:, 2, 4])
    assert len({tuple(line.get_color()) for line in lines}) == 12
    assert len(all_five.get_legend().get_texts()) == 5
    assert "λmax = 100" in strongest.get_xlabel()
    assert bands.get_ylabel()
    assert strongest.get_ylabel()


def test_correspondence_draws_source_target_and_errors() -> None:
    mesh = blob(3)
    flipped = np.random.default_rng(0).permutation(mesh.n_vertices)
    errors = np.linspace(0, 0.1, mesh.n_vertices)
    errors[:5] = np.nan
    figure = correspondence_figure(mesh, mesh, flipped, errors, size=SMALL)
    source, target, error, bar = figure.axes
    colors, view = position_colors(mesh), View(up="auto")
    np.testing.assert_array_equal(target.images[0].get_array(), render(mesh, colors, size=SMALL, view=view))
    np.testing.assert_array_equal(
        source.images[0].get_array(), render(mesh, pull_colors(colors, flipped), size=SMALL, view=view)
    )
    assert error.images[0].get_array().shape == (80, 60, 3)
    assert "geodesic error" in bar.get_ylabel()
    assert bar.get_ylim()[1] == pytest.approx(np.nanpercentile(errors, 99))
    assert len(correspondence_figure(mesh, mesh, flipped, size=SMALL).axes) == 2


def test_what_does_not_fit_is_refused() -> None:
    mesh = blob(1)
    with pytest.raises(ConfigError, match="one entry for each"):
        correspondence_figure(mesh, mesh, np.arange(3))
    with pytest.raises(ConfigError, match="0 curves"):
        cqc_figure({})
    with pytest.raises(ConfigError, match="conv2"):
        filters_figure(np.arange(4), {"conv1": np.zeros((4, 2)), "conv2": np.zeros((5, 2))})
    with pytest.raises(ConfigError, match="normaliser='mile'"):
        cqc_figure({"ours": Curve(T, T / 0.25, 0.1)}, normaliser="mile")


def test_pixels_of_a_figure_are_those_of_its_file(tmp_path: Path) -> None:
    figure = cqc_figure({"ours": Curve(T, T / 0.25, 0.1)})
    picture = figure_to_array(figure, dpi=60)
    assert picture.dtype == np.uint8
    save_figure(tmp_path / "a.png", figure, dpi=60)
    np.testing.assert_array_equal(np.asarray(Image.open(tmp_path / "a.png").convert("RGB")), picture)


@pytest.mark.parametrize("suffix", [".png", ".pdf"])
def test_files_are_the_same_every_time(tmp_path: Path, suffix: str) -> None:
    for name in "ab":
        save_figure(tmp_path / f"{name}{suffix}", cqc_figure({"ours": Curve(T, T / 0.25, 0.1)}), dpi=60)
    assert (tmp_path / f"a{suffix}").read_bytes() == (tmp_path / f"b{suffix}").read_bytes()
    with pytest.raises(ConfigError, match=r"\.docx"):
        save_figure(tmp_path / "a.docx", Figure())


def test_pyplot_and_its_global_state_are_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.pyplot", None)  # importing it now fails
    module = runpy.run_path(figures.__file__)
    assert module["cqc_figure"]({"ours": (T, T / 0.25, 0.1)}).axes
