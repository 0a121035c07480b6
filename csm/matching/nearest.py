"""Matching by the nearest neighbour in descriptor space."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, TypeAlias

import numpy as np
import torch
from numpy.typing import NDArray

from csm._types import IntArray
from csm.descriptors.base import Features
from csm.errors import ConfigError
from csm.matching.base import Described, Matcher
from csm.matching.maps import VertexMap

Rows: TypeAlias = NDArray[Any] | torch.Tensor | Features
_MAX_ELEMENTS = 2**25  # of one block of distances: 128 MiB in float32


@dataclass(frozen=True)
class Nearest(Matcher):
    """Each vertex goes to the vertex of the target whose features are nearest; see `nearest`."""

    name: ClassVar[str] = "nearest"

    def __call__(self, source: Described, target: Described, at: IntArray | None = None) -> VertexMap:
        """Return the nearest neighbours, on the device of the features."""
        indices = nearest(source.features, target.features, at=at)
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
    q, c = _tensor(queries), _tensor(candidates)
    if q.ndim != 2 or c.ndim != 2 or q.shape[1] != c.shape[1] or len(c) == 0:
        raise ConfigError(f"nearest: {tuple(q.shape)} against {tuple(c.shape)}; wanted (N, Q) and (N', Q) with N' > 0")
    if at is not None:
        found = np.full(len(q), -1, dtype=np.int64)
        found[at] = nearest(q[torch.as_tensor(at, device=q.device)], c, block=block)
        return found
    if q.dtype != c.dtype:
        q, c = q.double(), c.double()
    with torch.no_grad():
        if not (torch.isfinite(q).all() and torch.isfinite(c).all()):
            raise ConfigError(
                "nearest: a descriptor is not finite, so it has no nearest neighbour; look at the features"
            )
        centre = c.mean(0)
        first, unsure = _search(q - centre, c - centre, block)
        if c.dtype != torch.float64 and unsure.any():
            first[unsure] = _search(q[unsure].double() - centre, c.double() - centre, block)[0]
    return first.cpu().numpy()


def _tensor(rows: Rows) -> torch.Tensor:
    tensor = rows.detach() if isinstance(rows, torch.Tensor) else torch.as_tensor(np.asarray(rows))
    return tensor if tensor.dtype in (torch.float32, torch.float64) else tensor.float()


def _search(q: torch.Tensor, c: torch.Tensor, block: int) -> tuple[torch.Tensor, torch.Tensor]:
    """Return the first candidate within rounding of the nearest, and whether there are others."""
    rows = max(1, min(block, len(q), _MAX_ELEMENTS // len(c)))
    half_norms = 0.5 * c.square().sum(1)
    largest = half_norms.max().sqrt()
    rounding = 4.0 * c.shape[1] ** 0.5 * torch.finfo(c.dtype).eps * largest * (q.norm(dim=1) + largest)
    first = torch.empty(len(q), dtype=torch.int64, device=q.device)
    several = torch.empty(len(q), dtype=torch.bool, device=q.device)
    scores = torch.empty(rows, len(c), dtype=c.dtype, device=c.device)  # one piece of memory that stays in the cache
    for begin in range(0, len(q), rows):
        here = slice(begin, begin + rows)
        part = q[here]
        # Half the squared distance, less |q|^2 / 2.
        score = torch.addmm(half_norms, part, c.T, alpha=-1.0, out=scores[: len(part)])
        least, first[here] = score.min(1)
        limit = least + rounding[here]
        score.scatter_(1, first[here, None], torch.inf)
        several[here] = score.amin(1) <= limit
        tied = several[here].nonzero()[:, 0]
        others = (score[tied] <= limit[tied, None]).to(torch.uint8).argmax(1)
        first[begin + tied] = torch.minimum(first[begin + tied], others)
    return first, several
