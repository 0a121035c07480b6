"""Nearest neighbours against brute force in float64, with ties, blocks, offsets and both libraries."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from scipy.spatial.distance import cdist

from csm.errors import ConfigError
from csm.matching import nearest as module
from csm.matching._on_device import search
from csm.matching.base import Described
from csm.matching.nearest import Nearest, nearest
from tests.shapes import sphere


def features(n: int, width: int, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(n, width))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("block", [1, 37, 4096])
def test_equals_brute_force(dtype: type, block: int) -> None:
    q, c = (features(n, 24, n).astype(dtype) for n in (300, 411))
    expected = cdist(q.astype(np.float64), c.astype(np.float64)).argmin(1)
    np.testing.assert_array_equal(nearest(q, c, block=block), expected)
    np.testing.assert_array_equal(nearest(torch.from_numpy(q), torch.from_numpy(c), block=block), expected)


def test_a_large_common_offset_does_not_hide_small_differences() -> None:
    offset = np.float32(1000.0)
    q, c = (offset + 0.05 * features(200, 8, seed).astype(np.float32) for seed in (0, 1))
    np.testing.assert_array_equal(nearest(q, c), cdist(q.astype(np.float64), c.astype(np.float64)).argmin(1))


def test_float32_is_decided_in_float64_when_candidates_nearly_coincide() -> None:
    c = features(50, 16, 0).astype(np.float32)
    twins = np.concatenate([c + np.float32(1e-5), c])
    np.testing.assert_array_equal(nearest(c, twins), np.arange(50, 100))


@pytest.mark.parametrize("block", [5, 2048])
def test_ties_go_to_the_lowest_index(block: int) -> None:
    c = np.random.default_rng(0).integers(0, 3, (400, 3)).astype(np.float32)
    found = nearest(c, c, block=block)
    first = [int(np.flatnonzero((c == row).all(1))[0]) for row in c]
    assert found.tolist() == first
    assert nearest(np.zeros((7, 2)), np.zeros((9, 2))).tolist() == [0] * 7


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_the_lowest_of_several_nearest_is_found_wherever_the_others_lie(dtype: type) -> None:
    """Rounding may favour any copy of the nearest row, so the least score alone does not say which is first."""
    c = features(40, 64, 0).astype(dtype)
    copies = np.concatenate([c, c[::-1], c])
    q = c + dtype(0.1) * features(40, 64, 1).astype(dtype)
    for block in (1, 3, 40):
        assert nearest(q, copies, block=block).tolist() == list(range(40))


def test_memory_is_bounded_whatever_the_size(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[int] = []
    product = np.matmul

    def watched(*args: np.ndarray, out: np.ndarray) -> np.ndarray:
        seen.append(out.size)
        return product(*args, out=out)

    monkeypatch.setattr(module, "_MAX_ELEMENTS", 5000)
    monkeypatch.setattr(np, "matmul", watched)
    q, c = features(123, 4, 0), features(700, 4, 1)
    np.testing.assert_array_equal(nearest(q, c), cdist(q, c).argmin(1))
    assert max(seen) <= 5000


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize("block", [3, 4096])
def test_the_search_of_graphics_cards_finds_the_same(dtype: torch.dtype, block: int) -> None:
    q, c = (torch.from_numpy(features(n, 8, n)).to(dtype) for n in (60, 40))
    twins = torch.cat([c + 1e-6, c, c])
    for queries in (q, c):
        expected = nearest(queries, twins)
        np.testing.assert_array_equal(search(queries, twins, block), expected)
        np.testing.assert_array_equal(expected, cdist(queries.double(), twins.double()).argmin(1))


def test_rows_on_a_device_are_taken_as_those_of_the_processor() -> None:
    q, c = features(30, 5, 0), torch.from_numpy(features(20, 5, 1)).float()
    for at in (None, np.array([3, 17]), np.array([], dtype=int)):
        np.testing.assert_array_equal(module._on("cpu", q, c, at, 7), nearest(q, c, at=at))
    with pytest.raises(ConfigError, match=r"\(30, 5\) against \(20, 4\)"):
        module._on("cpu", q, c[:, 1:], None, 7)
    with pytest.raises(ConfigError, match="not finite"):
        module._on("cpu", q, c / 0, None, 7)


@pytest.mark.gpu
@pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a graphics card that PyTorch can use")
def test_a_graphics_card_finds_the_same() -> None:
    q, c = features(300, 24, 0), features(411, 24, 1)
    at = np.array([5, 299])
    for asked in (None, at):
        expected = nearest(q, c, at=asked)
        np.testing.assert_array_equal(
            nearest(torch.from_numpy(q).cuda(), torch.from_numpy(c).cuda(), at=asked), expected
        )


def test_equal_rows_far_from_the_others_are_decided_without_them() -> None:
    """Rows of large numbers make the rounding of float32 wide for all, so that many are decided in float64."""
    c = features(300, 16, 0).astype(np.float32)
    c[:5] *= 300
    q = c + np.float32(1e-3) * features(300, 16, 1).astype(np.float32)
    expected = cdist(q.astype(np.float64), c.astype(np.float64)).argmin(1)
    np.testing.assert_array_equal(nearest(q, c), expected)


@pytest.mark.parametrize(("dtype", "exponents"), [(np.float32, (-120, 126)), (np.float64, (-1000, 1020))])
def test_the_size_of_the_numbers_decides_nothing(dtype: type, exponents: tuple[int, ...]) -> None:
    rng = np.random.default_rng(5)
    q, c = (rng.standard_normal((n, 4)).astype(dtype) for n in (30, 40))
    expected = nearest(q, c)
    for exponent in exponents:
        np.testing.assert_array_equal(nearest(np.ldexp(q, exponent), np.ldexp(c, exponent)), expected)


def test_only_the_vertices_asked_for() -> None:
    q, c = features(30, 5, 0), features(20, 5, 1)
    at = np.array([3, 17, 4])
    for rows in (q, torch.from_numpy(q)):
        found = nearest(rows, c, at=at)
        assert found[at].tolist() == nearest(q, c)[at].tolist()
        assert (np.delete(found, at) == -1).all()
    assert (nearest(q, c, at=np.array([], dtype=int)) == -1).all()


def test_the_matcher_maps_from_the_source_to_the_target() -> None:
    mesh, other = sphere(1), sphere(2)
    here, there = (torch.from_numpy(features(m.n_vertices, 3, i)) for i, m in enumerate((mesh, other)))
    found = Nearest()(Described(mesh, here), Described(other, there))
    np.testing.assert_array_equal(found.indices, nearest(here, there))
    assert found.n_target == other.n_vertices
    some = Nearest()(Described(mesh, here), Described(other, there), at=np.array([7]))
    assert (some.indices >= 0).tolist() == [i == 7 for i in range(mesh.n_vertices)]
    assert some.indices[7] == found.indices[7]
    assert Nearest().parameters() == {}


def test_features_of_two_kinds_are_compared_in_double_precision() -> None:
    q, c = features(30, 5, 0), features(20, 5, 1)
    found = nearest(torch.from_numpy(q.astype(np.float32)), c)
    np.testing.assert_array_equal(found, cdist(q.astype(np.float32).astype(float), c).argmin(1))
    assert nearest(np.array([[3], [0]]), np.array([[0], [4]])).tolist() == [1, 0], "integers are numbers as well"


def test_what_has_no_nearest_neighbour_is_refused() -> None:
    with pytest.raises(ConfigError, match="not finite"):
        nearest(np.array([[np.nan]]), np.zeros((2, 1)))
    with pytest.raises(ConfigError, match=r"\(2, 3\) against \(2, 4\)"):
        nearest(np.zeros((2, 3)), np.zeros((2, 4)))
    with pytest.raises(ConfigError, match="N' > 0"):
        nearest(np.zeros((2, 3)), np.zeros((0, 3)))
