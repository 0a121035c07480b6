"""Dots and curves stand where their numbers are."""

from __future__ import annotations

import numpy as np
import pytest

from csm.errors import ConfigError
from csm.viewer.comparisons import Sweep, curve_panels, dots_figure, sweeps_figure, training_figure
from csm.viewer.figures import Curve


def test_dots_stand_in_the_row_of_their_name_from_top_to_bottom():
    figure = dots_figure(
        ["a", "b", "c"], {"error": {"fine": [1, 2, 3], "coarse": [4, 5, 6]}, "time": {"fine": [7, 8, 9]}}
    )
    error, time = figure.axes
    assert [text.get_text() for text in error.get_yticklabels()] == ["a", "b", "c"]
    np.testing.assert_array_equal(error.get_lines()[1].get_xdata(), [4, 5, 6])
    np.testing.assert_array_equal(error.get_lines()[1].get_ydata(), [0, 1, 2])
    assert error.yaxis_inverted()
    assert (error.get_xlabel(), time.get_xlabel()) == ("error", "time")
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["fine", "coarse"]
    assert error.get_xlim()[0] == 0


def test_a_single_condition_needs_no_legend():
    assert dots_figure(["a"], {"error": {"": [1.0]}}).legends == []


def test_dots_need_one_value_per_row():
    with pytest.raises(ConfigError, match=r"\['fine'\] to draw; wanted 2 values"):
        dots_figure(["a", "b"], {"error": {"fine": [1]}})


def curve(age: float) -> Curve:
    return Curve(np.array([0.0, 0.1, 0.2]), np.array([0.1, 0.5, 1.0]), age)


def test_curves_have_a_panel_per_set_and_one_style_per_method():
    figure = curve_panels({"fine": {"a": curve(0.2), "b": curve(0.1)}, "coarse": {"b": curve(0.3), "c": curve(0.15)}})
    fine, coarse = figure.axes
    assert (fine.get_title(), coarse.get_title()) == ("fine", "coarse")
    np.testing.assert_array_equal(fine.get_lines()[0].get_ydata(), [10, 50, 100])
    look = {str(line.get_label()): (line.get_color(), line.get_linestyle()) for line in fine.get_lines()}
    look |= {str(line.get_label()): (line.get_color(), line.get_linestyle()) for line in coarse.get_lines()}
    assert len(set(look.values())) == 3
    assert look["b"] == (fine.get_lines()[1].get_color(), fine.get_lines()[1].get_linestyle())
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["b", "c", "a"]


def test_curves_need_something_to_draw():
    with pytest.raises(ConfigError, match="nothing to draw"):
        curve_panels({"fine": {}})


def test_a_sweep_is_drawn_over_its_values_with_the_preset_marked():
    sweeps = [
        Sweep("K", [5, 10, 100], {"here": (np.array([3.0, 2.0, 1.0]), np.array([0.1, 0.2, 0.3]))}, 10),
        Sweep("D", [1, "many"], {"here": (np.array([5.0, 6.0]), np.zeros(2))}, 6),
    ]
    first, second = sweeps_figure(sweeps, "error").axes
    np.testing.assert_array_equal(first.get_lines()[0].get_ydata(), [3, 2, 1])
    assert [text.get_text() for text in first.get_xticklabels()] == ["5", "10", "100"]
    ring, nothing = (axes.get_lines()[-1] for axes in (first, second))
    assert (list(ring.get_xdata()), list(ring.get_ydata())) == ([1], [2.0])
    assert len(nothing.get_xdata()) == 0
    assert [text.get_text() for text in second.get_xticklabels()] == ["1", "many"]
    assert first.get_ylabel() == "error"
    assert first.get_ylim() == second.get_ylim()
    assert first.get_ylim()[0] == 0


def test_a_sweep_needs_values():
    with pytest.raises(ConfigError, match="at least one value"):
        sweeps_figure([Sweep("K", [], {"here": (np.zeros(0), np.zeros(0))}, 1)], "error")


def test_a_sweep_has_a_line_per_condition_each_with_its_preset_marked():
    none = np.zeros(2)
    lines = {"fine": (np.array([3.0, 2.0]), none), "coarse": (np.array([4.0, 5.0]), none)}
    (axes,) = sweeps_figure([Sweep("K", [5, 10], lines, 10)], "error").axes
    rings = [line for line in axes.get_lines() if line.get_markersize() == 9]
    assert [list(ring.get_ydata()) for ring in rings] == [[2.0], [5.0]]
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["preset", "fine", "coarse"]


def test_a_training_has_its_losses_beside_its_errors():
    curves = {"train/loss": [(1, 5.0), (2, 3.0)], "val/loss": [(2, 4.0)], "val/age": [(2, 0.1)]}
    losses, errors = training_figure(curves).axes
    assert [line.get_label() for line in losses.get_lines()] == ["train/loss", "val/loss"]
    np.testing.assert_array_equal(losses.get_lines()[0].get_xydata(), curves["train/loss"])
    np.testing.assert_array_equal(errors.get_lines()[0].get_xydata(), curves["val/age"])
    assert (losses.get_ylabel(), losses.get_yscale()) == ("loss", "log")
    assert len(training_figure({"train/loss": [(1, 5.0)]}).axes) == 1
    with pytest.raises(ConfigError, match="at least one curve"):
        training_figure({})
