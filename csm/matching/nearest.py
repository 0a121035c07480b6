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


@dataclass(frozen=True)
class Nearest(Matcher):
    """Each vertex goes to the vertex of the target whose features are nearest; see `nearest`."""

    name: ClassVar[str] = "nearest"

    def __call__(self, source: Described, target: Described, at: IntArray | None = None) -> VertexMap:
        """Return the nearest neighbours, on the device of the features."""
        indices = nearest(source.rows, target.rows, at=at)
        return VertexMap(indices, target.mesh.n_vertices, source.mesh.name, target.mesh.name)


def nearest(queries: Rows, candidates: Rows, *, at: IntArray | None = None, block: int = 256) -> IntArray:
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
    _require_finite(bool(np.isfinite(q).all() and np.isfinite(c).all()))
    return _search(q, c, c.mean(0), max(1, min(block, _MAX_ELEMENTS // len(c))))


def _require_comparable(q: tuple[int, ...], c: tuple[int, ...]) -> None:
    if len(q) != 2 or len(c) != 2 or q[1] != c[1] or c[0] == 0:
        raise ConfigError(f"nearest: {tuple(q)} against {tuple(c)}; wanted (N, Q) and (N', Q) with N' > 0")


def _require_finite(finite: bool) -> None:
    if not finite:
        raise ConfigError("nearest: a descriptor is not finite, so it has no nearest neighbour; look at the features")


def _search(q: NDArray[Any], c: NDArray[Any], centre: NDArray[Any], block: int) -> IntArray:
    """Return the first candidate within rounding of the nearest; float32 asks float64 which one that is."""
    near_q, near_c = q - centre, c - centre
    half_norms = 0.5 * np.einsum("ij,ij->i", near_c, near_c)
    largest = np.sqrt(half_norms.max())
    rounding = 4.0 * np.sqrt(c.shape[1]) * np.finfo(c.dtype).eps * largest
    limits = rounding * (np.linalg.norm(near_q, axis=1) + largest)
    first = np.empty(len(q), dtype=np.int64)
    scores = np.empty((min(block, len(q)), len(c)), dtype=c.dtype)  # one piece of memory that stays in the cache
    for begin in range(0, len(q), block):
        part = near_q[begin : begin + block]
        score = scores[: len(part)]
        np.matmul(part, near_c.T, out=score)
        np.subtract(half_norms, score, out=score)  # half the squared distance, less |q|^2 / 2
        first[begin : begin + block] = score.argmin(1)
        near = score <= (score.min(1) + limits[begin : begin + block])[:, None]
        unsure = np.flatnonzero(np.count_nonzero(near, axis=1) > 1)
        if len(unsure):
            first[begin + unsure] = _first_of(near[unsure], q[begin + unsure], c, centre, block)
    return first


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
