"""Which pairs of shapes and which points are compared, how far a miss is, and by what it is divided."""

from __future__ import annotations

import itertools
import logging
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from numbers import Integral
from typing import Literal, TypeAlias, get_args

import numpy as np

from csm._counts import counted
from csm._types import BoolArray, IntArray
from csm.errors import ConfigError, DataError
from csm.evaluation.metrics import FLIP_MARGIN
from csm.mesh.correspondence import PointMap
from csm.mesh.shape import Mesh
from csm.operators.geodesic import Method as Distance
from csm.operators.geodesic import can_be_exact

_log = logging.getLogger(__name__)

Normaliser: TypeAlias = Literal["diameter", "sqrt_area"]
Pair: TypeAlias = tuple[str, str]
_DISTANCES = {
    "exact": "exact geodesic distance",
    "heat": "geodesic distance by the heat method",
    "edge": "shortest path along edges",
}
_NORMALISERS = {
    "diameter": "geodesic diameter of the target (of the same distance; a lower bound by sweeps)",
    "sqrt_area": "square root of the area of the target",
}


@dataclass(frozen=True, eq=False)
class MeasuredPoints:
    """The P template points that are measured on a pair.

    Parameters
    ----------
    template
        Shape (P,), ascending.
    exact
        Shape (P,), which of them are measured exactly.
    """

    template: IntArray
    exact: BoolArray


def _name_pairs(pairs: Iterable[Sequence[str]]) -> tuple[Pair, ...]:
    """Return pairs of names as tuples, each once; ConfigError if something else is among them."""
    try:
        given = list(pairs)
        if any(isinstance(pair, str) for pair in given):
            raise TypeError("a name alone is no pair")
        found = Counter((source, target) for source, target in given)
    except (TypeError, ValueError) as error:
        raise ConfigError(f'protocol: pairs={pairs!r}; wanted "all" or a list of name pairs ({error})') from error
    twice = [pair for pair, times in found.items() if times > 1]
    if twice:
        more = f" and {len(twice) - 1} more are" if len(twice) > 1 else " is"
        _log.warning("protocol: the pair %s -> %s%s named several times; each is measured once", *twice[0], more)
    return tuple(found)


@dataclass(frozen=True)
class EvaluationProtocol:
    """The facts that a number needs beside it.

    Parameters
    ----------
    pairs
        "all": every ordered pair of different shapes; or a list of (source, target) names.
    sample
        How many of these pairs are drawn without replacement; None for all.
    points
        How many template points are measured, drawn without replacement, the same in every pair; None for all.  On
        fine meshes a few hundred points of all pairs give the mean error in a fraction of the time.
    seed
        Of the draws.
    distance
        Kind of distance between the true and the matched vertex; see `csm.operators.geodesic`.
    normaliser
        What distances are divided by: "diameter" (the ACD paper) or "sqrt_area" (functional maps).
    exact_points
        How many template points are measured exactly on each target, the others along edges and scaled (see
        `csm.evaluation.distances`); None for all.
    fallback
        Kind of distance on targets that are no manifold, where exact ones cannot be measured: "heat" or "edge"; None
        refuses such targets.
    drawn
        Which points are drawn: "template", the same ones of the template in every pair; or "pair", among those that the
        two shapes have in common and that a perturbation has left.
    """

    pairs: Literal["all"] | Sequence[Pair] = "all"
    sample: int | None = None
    points: int | None = None
    seed: int = 0
    distance: Distance = "exact"
    normaliser: Normaliser = "diameter"
    exact_points: int | None = None
    drawn: Literal["template", "pair"] = "template"
    fallback: Literal["heat", "edge"] | None = None

    def __post_init__(self) -> None:
        for what, value, known in (
            ("distance", self.distance, get_args(Distance)),
            ("normaliser", self.normaliser, get_args(Normaliser)),
            ("drawn", self.drawn, ("template", "pair")),
            ("fallback", self.fallback, (None, "heat", "edge")),
        ):
            if value not in known:
                raise ConfigError(f"protocol: {what}={value!r} is unknown; choose one of {', '.join(map(str, known))}")
        if isinstance(self.pairs, str) and self.pairs != "all":
            raise ConfigError(f'protocol: pairs={self.pairs!r} is unknown; wanted "all" or a list of name pairs')
        if not isinstance(self.pairs, str):
            object.__setattr__(self, "pairs", _name_pairs(self.pairs))
        for what, count in (("sample", self.sample), ("points", self.points), ("exact_points", self.exact_points)):
            if count is not None and not (isinstance(count, Integral) and count >= 1):
                raise ConfigError(f"protocol: {what}={count!r}; wanted a whole number from 1, or none for all")
        if not (isinstance(self.seed, Integral) and self.seed >= 0):
            raise ConfigError(f"protocol: seed={self.seed!r}; wanted a whole number from 0")
        if self.exact_points is not None and self.distance != "exact":
            raise ConfigError(f"protocol: exact_points={self.exact_points} goes with distance=exact only")
        if self.exact_points is not None and self.points is not None and self.drawn == "pair":
            raise ConfigError(
                f"protocol: exact_points={self.exact_points} are drawn on the template, so points={self.points} have "
                "to be as well: drawn=template"
            )

    def distance_on(self, mesh: Mesh) -> Distance:
        """Return the kind of distance on a target: `distance`, or `fallback` where that cannot be measured."""
        if self.fallback is None or self.distance != "exact" or can_be_exact(mesh):
            return self.distance
        _log.warning("%s: is no manifold, so its distances are measured by the method %r", mesh.label, self.fallback)
        return self.fallback

    def choose(self, names: Sequence[str], templates: Mapping[str, str] | None = None) -> list[Pair]:
        """Return the (source, target) pairs to evaluate among shapes of these names.

        Parameters
        ----------
        names
            Of the shapes.
        templates
            Name -> template: only shapes of one template can be compared.  None where all have the same.

        Raises
        ------
        DataError
            If a name is given twice, a pair names another shape or shapes of two templates, or there is no pair.

        Examples
        --------
        >>> EvaluationProtocol().choose(["a", "b"])
        [('a', 'b'), ('b', 'a')]
        """
        if len(set(names)) != len(names):
            twice = next(name for name in names if list(names).count(name) > 1)
            raise DataError(
                f"{len(names)} shapes have only {len(set(names))} different names; {twice!r} is there twice"
            )
        template = dict.fromkeys(names, "") if templates is None else templates
        unmapped = [name for name in names if name not in template]
        if unmapped:
            raise DataError(f"{unmapped[0]!r} and {len(unmapped) - 1} more of the shapes have no known correspondence")
        if isinstance(self.pairs, str):
            pairs = [(a, b) for a, b in itertools.permutations(names, 2) if template[a] == template[b]]
        else:
            pairs = list(self.pairs)
        unknown = sorted({name for pair in pairs for name in pair} - set(names))
        if unknown:
            raise DataError(
                f"the pair list names {unknown[0]!r} and {len(unknown) - 1} more that are not among the "
                f"{counted(len(names), 'shape')} that can be evaluated"
            )
        across = [(a, b) for a, b in pairs if template[a] != template[b]]
        if across:
            source, target = across[0]
            raise DataError(
                f"the pair list has {source} -> {target} and {len(across) - 1} more whose maps start from different "
                "templates, so that nothing tells which vertices correspond; leave them out"
            )
        if not pairs:
            raise DataError(f"there is no pair to evaluate: {counted(len(names), 'shape')}, pairs={self.pairs!r}")
        if self.sample is not None and self.sample < len(pairs):
            kept = np.random.default_rng(self.seed).choice(len(pairs), self.sample, replace=False)
            pairs = [pairs[i] for i in sorted(kept)]
        return pairs

    def points_of(self, source: PointMap, target: PointMap, left: BoolArray | None = None) -> MeasuredPoints:
        """Return which template points of a pair are measured, and which of these exactly.

        Parameters
        ----------
        source, target
            Maps from the template, shape (T,), to the vertices of the two shapes; -1 where a point is not known.
        left
            Shape (N_target,), which vertices a perturbation has left of the target; None for all.
        """
        s, t = source.indices, target.indices
        known = (s >= 0) & (t >= 0)
        if left is not None:
            known[known] = left[t[known]]
        chosen = known.copy()
        if self.points is not None and self.drawn == "pair":
            common = np.flatnonzero(known)
            chosen[:] = False
            chosen[common[self._order(len(common))[: self.points]]] = True
        elif self.points is not None and self.points < len(t):
            chosen[self._order(len(t))[self.points :]] = False
        exact = chosen
        if self.exact_points is not None:
            order = self._order(len(t))
            exact = np.zeros_like(chosen)
            exact[order[(t >= 0)[order]][: self.exact_points]] = True
            exact &= chosen
        return MeasuredPoints(np.flatnonzero(chosen), exact[chosen])

    def _order(self, n: int) -> IntArray:
        return np.random.default_rng(self.seed).permutation(n)

    def _points(self) -> str:
        if self.points is None:
            return "all template points known on both shapes"
        if self.drawn == "pair":
            return f"{self.points} of the template points known on both shapes (drawn with seed {self.seed})"
        return f"those of {self.points} (drawn with seed {self.seed}) template points known on both shapes"

    def describe(self, n_pairs: int | None = None) -> str:
        """Say the protocol in words, for captions and result files.

        Examples
        --------
        >>> EvaluationProtocol(sample=50, seed=1, distance="edge", normaliser="sqrt_area").describe()[:58]
        '50 pairs (drawn with seed 1 from all ordered pairs without'
        """
        which = "all ordered pairs without self-pairs" if self.pairs == "all" else "a given list of pairs"
        if self.sample is not None:
            which = f"drawn with seed {self.seed} from {which}"
            n_pairs = self.sample if n_pairs is None else n_pairs
        scaled = (
            ""
            if self.exact_points is None
            else f", of which {self.exact_points} per target exactly and the others by scaled paths along edges"
        )
        return (
            f"{'' if n_pairs is None else f'{n_pairs} '}pairs ({which}); error = {_DISTANCES[self.distance]} on the "
            f"target from the true to the matched vertex, divided by the {_NORMALISERS[self.normaliser]}; "
            f"mean over {self._points()}{scaled}, pooled over pairs; a match on "
            f"another component counts as one diameter; left-right flip: nearer to the mirrored truth "
            f"by more than {FLIP_MARGIN:g}." + self._instead()
        )

    def _instead(self) -> str:
        return f" On targets that are no manifold: {_DISTANCES[self.fallback]}." if self.fallback else ""
