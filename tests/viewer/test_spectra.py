"""The eigenvalue figure shows the eigenvalues, and Weyl's law where it belongs."""

from __future__ import annotations

import numpy as np
import pytest

from csm.errors import ConfigError
from csm.viewer.spectra import eigenvalues_figure, resolutions_figure


def sphere_spectrum(degrees: int) -> np.ndarray:
    """Of the round sphere of area 1: l (l + 1) 4 pi, 2 l + 1 times."""
    return np.concatenate([np.full(2 * m + 1, m * (m + 1) * 4 * np.pi) for m in range(degrees)])


def test_lines_are_the_eigenvalues_and_the_sphere_follows_weyl() -> None:
    spectra = {"sphere": sphere_spectrum(20), "few": sphere_spectrum(3)}
    axes = eigenvalues_figure(spectra).axes[0]
    first, second, weyl = axes.get_lines()
    np.testing.assert_array_equal(first.get_ydata(), spectra["sphere"])
    np.testing.assert_array_equal(second.get_xdata(), np.arange(9))
    assert weyl.get_xdata()[-1] == 399
    assert weyl.get_ydata()[-1] == pytest.approx(spectra["sphere"][-1], rel=0.06)
    assert [text.get_text() for text in axes.get_legend().get_texts()][:2] == ["sphere", "few"]
    assert "λ (1 / area)" in axes.get_ylabel()
    assert "index" in axes.get_xlabel()


@pytest.mark.parametrize("spectra", [{}, {"a": []}, {"a": np.zeros((2, 2))}])
def test_nothing_to_draw_is_refused(spectra: dict[str, np.ndarray]) -> None:
    with pytest.raises(ConfigError, match="eigenvalues figure"):
        eigenvalues_figure(spectra)


def test_resolutions_stand_over_their_deviation_from_the_reference():
    fine = np.arange(5) * 10.0
    spectra = {"LBO": {"coarse": fine * 1.02, "fine": fine}, "ALBO": {"coarse": fine * 0.5, "fine": fine}}
    figure = resolutions_figure(spectra, "fine")
    above, other_above, below, other_below = figure.axes
    assert [axes.get_title() for axes in (above, other_above)] == ["LBO", "ALBO"]
    np.testing.assert_array_equal(above.get_lines()[0].get_ydata(), fine * 1.02)
    np.testing.assert_allclose(below.get_lines()[0].get_ydata(), 2)
    np.testing.assert_allclose(other_below.get_lines()[0].get_ydata(), -50)
    np.testing.assert_array_equal(below.get_lines()[0].get_xdata(), [1, 2, 3, 4])
    assert "from\nfine" in below.get_ylabel()
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["coarse", "fine"]


@pytest.mark.parametrize("lines", [{"coarse": np.ones(3)}, {"coarse": np.ones(3), "fine": np.ones(4)}])
def test_resolutions_need_the_reference_and_one_length(lines):
    with pytest.raises(ConfigError, match=r"\['LBO'\] to draw"):
        resolutions_figure({"LBO": lines}, "fine")
