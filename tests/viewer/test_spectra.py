"""The figure of eigenvalues shows them, and below them their deviation from the reference."""

from __future__ import annotations

import numpy as np
import pytest

from csm.errors import ConfigError
from csm.viewer.spectra import resolutions_figure


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


def test_nothing_to_draw_is_refused():
    with pytest.raises(ConfigError, match="nothing to draw"):
        resolutions_figure({}, "fine")
