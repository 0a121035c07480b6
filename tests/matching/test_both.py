from __future__ import annotations

import numpy as np
import pytest
import torch

from csm.matching import matcher
from csm.matching.base import Described
from csm.matching.both import match_both_ways
from tests.shapes import blob


@pytest.mark.parametrize("rule", ["nearest", "nearest+joint", "nearest+zoomout"])
def test_both_ways_are_matched_and_judged(rule):
    ball, order = blob(3), np.random.default_rng(0).permutation(blob(3).n_vertices)
    here = Described(ball, torch.tensor(ball.vertices))
    there = Described(ball.__class__(ball.vertices[order], np.argsort(order)[ball.faces]), here.features[order])
    found = match_both_ways(matcher(rule), here, there)
    assert (found.forward.vertex_map.indices == np.argsort(order)).mean() > 0.98
    assert (found.backward.vertex_map.indices == order).mean() > 0.98
    assert np.median(found.forward.confidence.values) > 0.9
    assert len(found.backward.confidence.values) == len(order)
    assert bool(found.text) == ("+" in rule)
