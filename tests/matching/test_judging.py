from __future__ import annotations

import numpy as np
import torch

from csm.matching.judging import judged


def test_figures_are_those_of_the_formulas():
    rng = np.random.default_rng(0)
    c, here, there = rng.standard_normal((2, 5, 5)), np.sort(rng.random(5)), np.sort(rng.random(5))
    found = judged(*(torch.from_numpy(x) for x in (c, here, there)))
    for i in range(2):
        stretch = np.linalg.norm(c[i].T @ c[i] - np.eye(5)) / np.sqrt(5)
        gap = np.linalg.norm(c[i] @ np.diag(there) - np.diag(here) @ c[i])
        size = np.sqrt(np.linalg.norm(here) * np.linalg.norm(there))
        np.testing.assert_allclose([found.stretch[i], found.commutation[i]], [stretch, gap / size])
