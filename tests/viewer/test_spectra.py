"""The eigenvalue figure shows the eigenvalues, and Weyl's law where it belongs."""

from __future__ import annotations

import numpy as np
import pytest

from csm.errors import ConfigError
from csm.viewer.spectra import eigenvalues_figure


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
