"""Matching by the nearest neighbour in descriptor space."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from csm._types import IntArray
from csm.errors import ConfigError
from csm.matching.base import Described, Matcher
from csm.matching.maps import VertexMap
from csm.matching.rows import Rows, as_array, is_tensor

_MAX_ELEMENTS = 2**25  # of one block of distances: 128 MiB in float32
_GROUP = 32  # candidates whose least score is taken first


@dataclass(frozen=True)
class Nearest(Matcher):
    """Each vertex goes to the vertex of the target whose features are nearest; see `nearest`."""

    name: ClassVar[str] = "nearest"

    def __call__(self, source: Described, target: Described, at: IntArray | None = None) -> VertexMap:
        """Return the nearest neighbours, on the device of the features."""
        indices = nearest(source.rows, target.rows, at=at)
        return VertexMap(indices, target.mesh.n_vertices, source.mesh.name, target.mesh.name)


def nearest(queries: Rows, candidates: Rows, *, at: IntArray | None = None, block: int = 512) -> IntArray:
    """Find the nearest candidate (Euclidean) of each query, in blocks of bounded memory.

    float32 rows are compared by float32 products first; queries for which rounding could decide are done again in
    float64.  Of candidates that float64 products cannot tell apart the one with the lowest index is taken, so the
    answer depends on neither the block size nor the number of threads.

    Parameters
    ----------
    queries
        Shape (N, Q), numpy or torch, float32 or float64 (others are taken as float32).
    candidates
        Shape (N', Q), the same kind of number.
    at
        Numbers of the queries that are asked for, such as the vertices with known ground truth; the others get -1.
        None for all.
    block
        Queries at a time; fewer when N' is so large that a block of distances would exceed 2^25 numbers.

    Returns
    -------
    IntArray
        Shape (N,), indices into `candidates`.

    Raises
    ------
    ConfigError
        If the widths differ, there is no candidate, or a number is not finite.

    Examples
    --------
    >>> nearest(np.array([[0.9, 0.0], [0.0, 0.2]]), np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 0.0]]))
    array([1, 0])
    """
    device = next((str(rows.device) for rows in (queries, candidates) if is_tensor(rows)), "cpu")
    if device != "cpu":
        return _on(device, queries, candidates, at, block)
    q, c = as_array(queries), as_array(candidates)
    _require_comparable(q.shape, c.shape)
    if at is not None:
        found = np.full(len(q), -1, dtype=np.int64)
        found[at] = nearest(q[at], c, block=block)
        return found
    if q.dtype != c.dtype:
        q, c = q.astype(np.float64), c.astype(np.float64)
    _require_finite(bool(np.isfinite([f(initial=0) for rows in (q, c) for f in (rows.min, rows.max)]).all()))
    q, c = _of_usual_size(q, c)
    return _search(q, c, c.mean(0), max(1, min(block, _MAX_ELEMENTS // len(c))))


def _of_usual_size(q: NDArray[Any], c: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the rows, both scaled by one power of two where their squares could overflow or vanish."""
    largest = max(float(max(rows.max(initial=0), -rows.min(initial=0))) for rows in (q, c))
    bound = float(np.finfo(c.dtype).max) ** 0.25
    if largest == 0 or 1 / bound < largest < bound:
        return q, c
    exponent = -int(np.frexp(largest)[1])
    return np.ldexp(q, exponent), np.ldexp(c, exponent)


def _require_comparable(q: tuple[int, ...], c: tuple[int, ...]) -> None:
    if len(q) != 2 or len(c) != 2 or q[1] != c[1] or c[0] == 0:
        raise ConfigError(f"nearest: {tuple(q)} against {tuple(c)}; wanted (N, Q) and (N', Q) with N' > 0")


def _require_finite(finite: bool) -> None:
    if not finite:
        raise ConfigError("nearest: a descriptor is not finite, so it has no nearest neighbour; look at the features")


def _search(q: NDArray[Any], c: NDArray[Any], centre: NDArray[Any], block: int) -> IntArray:
    """Return the first candidate within rounding of the nearest; float32 asks float64 which one that is.

    The scores of a block of queries, half the squared distances less |q|^2 / 2, are a product of matrices; what follows
    reads them once, for the least of every 32 candidates, and looks closer where that tells it to.
    """
    table, largest = _table(c - centre)
    groups = table.shape[1] // _GROUP
    rounding = 4.0 * np.sqrt(c.shape[1]) * np.finfo(c.dtype).eps * largest
    first = np.empty(len(q), dtype=np.int64)
    size = min(block, len(q))  # one piece of memory for all blocks
    queries, scores = np.ones((size, len(table)), dtype=c.dtype), np.empty((size, table.shape[1]), dtype=c.dtype)
    for begin in range(0, len(q), block):
        part = queries[: len(q) - begin]
        score = scores[: len(part)]
        np.subtract(q[begin : begin + block], centre, out=part[:, :-1])
        np.matmul(part, table, out=score)
        grouped = score.reshape(len(part), _GROUP, groups)
        least = grouped.min(axis=1)
        best = least.argmin(1)
        within = grouped[np.arange(len(part)), :, best]
        first[begin : begin + block] = within.argmin(1) * groups + best
        limit = (least.min(1) + rounding * (np.linalg.norm(part[:, :-1], axis=1) + largest))[:, None]
        several = [np.count_nonzero(each <= limit, axis=1) > 1 for each in (least, within)]
        unsure = np.flatnonzero(several[0] | several[1])
        if len(unsure):
            near = score[unsure, : len(c)] <= limit[unsure]
            first[begin + unsure] = _first_of(near, q[begin + unsure], c, centre, block)
    return first


def _table(c: NDArray[Any]) -> tuple[NDArray[Any], float]:
    """Return a matrix whose product with rows (q, 1) is |c|^2 / 2 - q c, and the greatest |c|.

    Its columns that fill a group make it infinite.
    """
    (n, width), fill = c.shape, -len(c) % _GROUP
    half_norms = 0.5 * np.einsum("ij,ij->i", c, c)
    table = np.zeros((n + fill, width + 1), dtype=c.dtype)
    np.negative(c, out=table[:n, :-1])
    table[:n, -1], table[n:, -1] = half_norms, np.inf
    return table.T, float(np.sqrt(half_norms.max()))


def _first_of(near: NDArray[np.bool_], q: NDArray[Any], c: NDArray[Any], centre: NDArray[Any], block: int) -> IntArray:
    """Return the first of the nearest among the candidates that rounding cannot tell apart."""
    if c.dtype == np.float64:
        first: IntArray = near.argmax(1)
        return first
    columns = np.flatnonzero(near.any(0))
    return columns[_search(q.astype(np.float64), c[columns].astype(np.float64), centre, block)]


def _on(device: str, queries: Rows, candidates: Rows, at: IntArray | None, block: int) -> IntArray:
    """Do what `nearest` does on a device other than the processor."""
    import torch

    from csm.matching._on_device import search

    q, c = (
        rows if is_tensor(rows) else torch.as_tensor(np.asarray(rows), device=device) for rows in (queries, candidates)
    )
    q, c = (rows if rows.dtype in (torch.float32, torch.float64) else rows.float() for rows in (q.detach(), c.detach()))
    _require_comparable(tuple(q.shape), tuple(c.shape))
    found = np.full(len(q), -1, dtype=np.int64)
    asked = np.arange(len(q)) if at is None else at
    q = q[torch.as_tensor(asked, device=q.device)]
    if q.dtype != c.dtype:
        q, c = q.double(), c.double()
    _require_finite(bool(torch.isfinite(q).all() and torch.isfinite(c).all()))
    found[asked] = search(q, c, max(1, min(block, _MAX_ELEMENTS // len(c))))
    return found
