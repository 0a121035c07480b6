"""What a classifier says of a shape, and what a description knows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest
import torch

from csm.data.store import Store
from csm.errors import ConfigError
from csm.matching.base import Classifier, Described, Matcher, votes
from csm.matching.maps import VertexMap
from csm.operators import Operators
from tests.shapes import sphere


def problem() -> tuple[torch.Tensor, torch.Tensor, Classifier]:
    g = torch.Generator().manual_seed(0)
    descriptor, other, weight, bias = (torch.randn(*n, generator=g) for n in ((20, 5), (13, 5), (9, 5), (9,)))
    return descriptor, other, Classifier(weight, bias)


@pytest.mark.parametrize("block", [1, 3, 100])
def test_votes_are_the_greatest_probabilities_by_row_and_by_column(block: int) -> None:
    descriptor, other, classifier = problem()
    for rows in (descriptor, other):
        found = votes(rows, classifier, block=block)
        p = torch.softmax(rows @ classifier.weight.T + classifier.bias, 1).numpy()
        np.testing.assert_array_equal(found.classes, p.argmax(1))
        np.testing.assert_array_equal(found.vertices, p.argmax(0))


def test_of_equal_vertices_the_first_is_taken_whatever_the_block() -> None:
    descriptor, _, classifier = problem()
    twice = torch.cat([descriptor, descriptor])
    for block in (1, 7, 20, 40):
        np.testing.assert_array_equal(
            votes(twice, classifier, block=block).vertices, votes(descriptor, classifier).vertices
        )


def test_what_is_not_finite_has_no_most_probable_class() -> None:
    descriptor, _, classifier = problem()
    with pytest.raises(ConfigError, match="not finite"):
        votes(descriptor * torch.nan, classifier)


def test_rows_are_known_as_a_tensor_and_as_an_array() -> None:
    rows = np.arange(24.0).reshape(12, 2)
    for given in (rows, torch.from_numpy(rows)):
        described = Described(sphere(0), given)
        assert described.features.dtype == torch.float64
        assert described.values.dtype == np.float32
        np.testing.assert_array_equal(described.features.numpy(), rows)
        np.testing.assert_array_equal(described.values, rows)
        assert repr(described).endswith(", 2 features)")


def test_a_shape_votes_once_and_only_with_a_classifier() -> None:
    descriptor, _, classifier = problem()
    described = Described(sphere(1), descriptor, classifier)
    assert described.votes is described.votes
    with pytest.raises(ConfigError, match=r"matching=argmax needs a trained network .* use the \.ckpt file"):
        _ = Described(sphere(1), descriptor).votes


def test_eigenpairs_are_those_of_the_mesh_at_unit_area_and_kept(tmp_path) -> None:
    mesh, store = sphere(2, radius=3.0), Store(tmp_path)
    described = Described(mesh, torch.zeros(162, 1), store=store)
    np.testing.assert_allclose(described.spectrum(9).evals, Operators(mesh).lbo(9).evals, atol=1e-8)
    assert store.computed == 1
    described.spectrum(9)
    assert store.computed == 1
    assert described.spectrum(9).mass.sum() == pytest.approx(1.0)


def test_the_parameters_of_a_matcher_are_its_fields() -> None:
    @dataclass(frozen=True)
    class Mine(Matcher):
        k: int = 3
        name: ClassVar[str] = "mine"

        def __call__(self, source, target, at=None):
            return VertexMap(np.zeros(source.mesh.n_vertices, dtype=int), target.mesh.n_vertices)

    assert Mine(5).parameters() == {"k": 5}
    assert Mine() == Mine(3)
