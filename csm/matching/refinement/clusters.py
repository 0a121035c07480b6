"""Nearest rows among very many, by looking only into the clusters that are near."""

from __future__ import annotations

import torch
from torch import Tensor

from csm._types import IntArray
from csm.matching.nearest import nearest
from csm.matching.refinement.batch import nearest_rows

LARGE = 2**29
"""Number of distances above which clusters are used: about 23,000 vertices on either shape."""

_NEAR = 12  # clusters around that of a query which are searched


def nearest_of_many(queries: Tensor, candidates: Tensor, seeds: IntArray, *, large: int = LARGE) -> Tensor:
    """Return the numbers of the nearest candidates (q, D) of queries (p, D), of many through clusters.

    Up to `large` distances all are computed, in float64 where rounding could decide, so that a shape is mapped to
    itself by the identity.  Above, each candidate belongs to the nearest of some of them, the seeds; a query is
    compared with the candidates of the seed that is nearest to it and of the seeds around that.  What is missed lies
    farther away than candidates of twelve clusters, which for rows of functions that are smooth on a surface hardly
    happens: a test compares both ways.

    Parameters
    ----------
    queries, candidates
        What is compared, float32.
    seeds
        Numbers of candidates, spread over them.
    large
        See above.
    """
    if len(queries) * len(candidates) <= large or len(seeds) <= _NEAR:
        return torch.from_numpy(nearest(queries, candidates)).to(queries.device)
    centres = candidates[torch.from_numpy(seeds).to(candidates.device)]
    members = _by_cluster(nearest_rows(candidates, centres), len(seeds))
    asking = _by_cluster(nearest_rows(queries, centres), len(seeds))
    around = torch.cdist(centres, centres).topk(_NEAR, largest=False).indices
    found = torch.zeros(len(queries), dtype=torch.int64, device=queries.device)
    for cluster, rows in enumerate(asking):
        if len(rows):
            among = torch.cat([members[int(other)] for other in around[cluster]])
            found[rows] = among[nearest_rows(queries[rows], candidates[among])]
    return found


def _by_cluster(owner: Tensor, n: int) -> list[Tensor]:
    """Return for each of `n` clusters the numbers of its members, ascending."""
    order = torch.argsort(owner, stable=True)
    return list(torch.split(order, torch.bincount(owner, minlength=n).tolist()))
