from __future__ import annotations

import numpy as np
import pytest
import torch

from csm.errors import ConfigError
from csm.matching.base import Classifier, Described
from csm.matching.classifier import Argmax
from tests.shapes import sphere


def test_vertices_go_through_the_template_and_from_there_to_the_target():
    g = torch.Generator().manual_seed(0)
    classifier = Classifier(torch.randn(9, 5, generator=g), torch.randn(9, generator=g))
    mesh, other = sphere(1), sphere(2)
    here, there = (torch.randn(m.n_vertices, 5, generator=g) for m in (mesh, other))
    found = Argmax()(Described(mesh, here, classifier), Described(other, there, classifier))
    p, q = (torch.softmax(x @ classifier.weight.T + classifier.bias, 1).numpy() for x in (here, there))
    np.testing.assert_array_equal(found.indices, q.argmax(0)[p.argmax(1)])
    assert (found.n_target, len(found.indices)) == (other.n_vertices, mesh.n_vertices)


def test_a_descriptor_has_no_classifier():
    described = Described(sphere(1), torch.zeros(42, 3))
    with pytest.raises(ConfigError, match="needs a trained network"):
        Argmax()(described, described)
