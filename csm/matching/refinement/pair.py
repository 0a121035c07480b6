"""Two described shapes side by side: their eigenfunctions, and their features at one scale."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import torch
from torch import Tensor

from csm.errors import ConfigError
from csm.matching.base import Described
from csm.matching.embedded import Embedded, Samples

_FOR_AXES = 1000  # samples of each shape that the principal axes of the features are computed from
_ROUNDING = 1e-5  # spread of features, as a part of their size, that is none
_WIDTH = 64  # features that are kept


@dataclass(frozen=True, eq=False)
class Pair:
    """Two shapes to refine a map between.

    Parameters
    ----------
    source, target
        The shapes.
    features_source, features_target
        Shapes (N_source, q) and (N_target, q), float32: descriptors in their joint principal axes, centred, with a
        total variance of 1.  The first K eigenfunctions over sqrt(K) have a total variance of 1 as well.
    """

    source: Embedded
    target: Embedded
    features_source: Tensor
    features_target: Tensor

    @classmethod
    def of(cls, source: Described, target: Described) -> Pair:
        """Return the pair of two described shapes.

        Raises
        ------
        ConfigError
            If their descriptions differ in width or are not finite.
        """
        widths = source.features.shape[1], target.features.shape[1]
        if widths[0] != widths[1]:
            raise ConfigError(
                f"descriptors of {widths[0]} and {widths[1]} columns; wanted the same ones of both shapes"
            )
        here, there = source.features.float(), target.features.float()
        if not (torch.isfinite(here).all() and torch.isfinite(there).all()):
            raise ConfigError("a descriptor is not finite, so it cannot guide a refinement; look at the features")
        drawn = [(e, e.samples(_FOR_AXES)) for e in (source.embedded, target.embedded)]
        rows = [f[samples.at] for f, (_, samples) in zip((here, there), drawn, strict=True)]
        weights = [samples.areas / samples.areas.sum() / 2 for _, samples in drawn]
        centre = sum((w @ row for w, row in zip(weights, rows, strict=True)), torch.zeros_like(rows[0][0]))
        scaled = torch.cat([w.sqrt()[:, None] * (row - centre) for w, row in zip(weights, rows, strict=True)])
        _, lengths, axes = torch.linalg.svd(scaled, full_matrices=False)
        total = lengths.square().sum().sqrt()
        known = total > _ROUNDING * centre.norm()
        axes = axes[:_WIDTH].T * torch.where(known, 1 / total, torch.zeros_like(total))
        return cls(source.embedded, target.embedded, (here - centre) @ axes, (there - centre) @ axes)

    @cached_property
    def reversed(self) -> Pair:
        """The pair with source and target exchanged."""
        return Pair(self.target, self.source, self.features_target, self.features_source)

    @property
    def k(self) -> int:
        """How many eigenfunctions both shapes have."""
        return min(self.source.k, self.target.k)

    def sampled(self, n: int) -> SampledPair:
        """Return the pair at `n` samples of each shape."""
        s, t = self.source.samples(n), self.target.samples(n)
        return SampledPair(self, s, t, self.features_source[s.at], self.features_target[t.at])


@dataclass(frozen=True, eq=False)
class SampledPair:
    """A pair at p and q samples of its shapes; maps of it, (B, p), go from samples to numbers of samples.

    Parameters
    ----------
    pair
        The whole.
    source, target
        The samples.
    features_source, features_target
        Shapes (p, Q) and (q, Q).
    """

    pair: Pair
    source: Samples
    target: Samples
    features_source: Tensor
    features_target: Tensor

    @cached_property
    def apart(self) -> Tensor:
        """Squared distances of the features, shape (p, q)."""
        return torch.cdist(self.features_source, self.features_target).square()
