"""Many functional maps at once, at samples of the shapes: a step of refinement, and how good each of them is.

B matrices (B, K, K) take coefficients on the target to coefficients on the source, as everywhere in csm; B maps (B, p)
give for each of p samples of the source the number of a sample of the target.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from csm.matching.embedded import Samples
from csm.matching.judging import judged
from csm.matching.refinement.pair import SampledPair

_BLOCK = 2**21  # numbers of a block of distances


def nearest_rows(queries: Tensor, candidates: Tensor, bias: Tensor | None = None) -> Tensor:
    """Return the numbers of the nearest candidates (q, D) of queries (..., D), in float32 products.

    Parameters
    ----------
    queries, candidates
        What is compared.
    bias
        Shape (p, q), for queries (B, p, D): half of squared distances that are added to those of each of the B.
    """
    rows = queries.reshape(-1, queries.shape[-1])
    half_norms = 0.5 * candidates.square().sum(1)
    found = torch.empty(len(rows), dtype=torch.int64, device=rows.device)
    size = max(1, _BLOCK // len(candidates)) if bias is None else len(bias)
    scores = torch.empty(size, len(candidates), dtype=rows.dtype, device=rows.device)  # stays in the cache
    added = half_norms if bias is None else half_norms + bias
    for begin in range(0, len(rows), size):
        part = rows[begin : begin + size]
        score = torch.addmm(added, part, candidates.T, alpha=-1.0, out=scores[: len(part)])
        found[begin : begin + size] = score.argmin(1)
    return found.reshape(queries.shape[:-1])


def matrices_of(maps: Tensor, pair: SampledPair, k: int) -> Tensor:
    """Return the functional maps (B, k, k) of maps (B, p): least squares over the samples, weighted by their areas."""
    phi = pair.source.evecs[:, :k].double()
    weighted = phi * pair.source.areas[:, None]
    inverse = torch.linalg.solve(weighted.T @ phi, weighted.T).float()
    return torch.einsum("kp,bpl->bkl", inverse, pair.target.evecs[:, :k][maps])


def orthogonal(matrices: Tensor) -> Tensor:
    """Return the nearest orthogonal matrices (B, k, k)."""
    u, _, v = torch.linalg.svd(matrices)
    factors: Tensor = u @ v
    return factors


@dataclass(frozen=True)
class Guides:
    """What steers a step beside the eigenfunctions.

    Parameters
    ----------
    descriptor
        Weight of the features, whose total variance is 1 like that of the eigenfunctions.
    orientation
        Weight of the pseudo-scalars n . (grad phi_i x grad phi_j), which keeps maps from being mirrored.
    """

    descriptor: float
    orientation: float


def step(matrices: Tensor, pair: SampledPair, guides: Guides) -> Tensor:
    """Return the maps (B, p) of functional maps (B, k, k), made orthogonal first.

    Each sample goes to the nearest in [pulled-back eigenfunctions, features, pulled-back pseudo-scalars].
    """
    k = matrices.shape[-1]
    matrices = orthogonal(matrices)
    queries = [torch.einsum("pk,bkl->bpl", pair.source.evecs[:, :k], matrices) / k**0.5]
    candidates = [pair.target.evecs[:, :k] / k**0.5]
    if guides.orientation > 0:
        turned, turns = _turns(matrices, pair.source, pair.target)
        queries.append(guides.orientation * turned)
        candidates.append(guides.orientation * turns)
    bias = 0.5 * guides.descriptor**2 * pair.apart if guides.descriptor > 0 else None
    return nearest_rows(torch.cat(queries, -1), torch.cat(candidates, -1), bias)


def _turns(matrices: Tensor, source: Samples, target: Samples) -> tuple[Tensor, Tensor]:
    """Return the pseudo-scalars of the pulled-back functions, (B, p, J), and of the target's own, (q, J), scaled."""
    k = min(matrices.shape[-1], source.turns.shape[-1], target.turns.shape[-1])
    i, j = torch.triu_indices(k, k, 1, device=matrices.device)
    turns = target.turns[:, i, j]
    low = matrices[:, :k, :k]
    half = torch.einsum("bai,pac->bpic", low, source.turns[:, :k, :k])
    turned = torch.einsum("bpic,bcj->bpij", half, low)[:, :, i, j]
    size = (turns.square() * target.areas[:, None]).sum().sqrt()
    size = torch.where(size > 0, size, torch.ones_like(size))
    return turned / size, turns / size


@dataclass(frozen=True, eq=False)
class Scores:
    """What is known of B maps without ground truth, shape (B,) each; less is better.

    Parameters
    ----------
    stretch, commutation
        Of the functional map, see `csm.matching.judging.judged`.
    descriptor
        Root of the mean squared distance of the features, whose total variance is 1.
    """

    stretch: Tensor
    commutation: Tensor
    descriptor: Tensor

    @property
    def total(self) -> Tensor:
        """Their sum, by which maps are chosen."""
        return self.stretch + self.commutation + self.descriptor


def scores(maps: Tensor, pair: SampledPair, k: int) -> Scores:
    """Judge maps (B, p) by their functional maps of k x k and by the features."""
    matrices = matrices_of(maps, pair, k)
    stretch, commutation = judged(matrices, pair.pair.source.evals[:k], pair.pair.target.evals[:k])
    apart = (pair.features_source - pair.features_target[maps]).square().sum(-1)
    areas = pair.source.areas / pair.source.areas.sum()
    return Scores(stretch, commutation, (apart @ areas).sqrt())
