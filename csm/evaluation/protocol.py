"""Which pairs of shapes are compared, how far a miss is, and by what it is divided; and the evaluation that follows."""

from __future__ import annotations

import itertools
import multiprocessing
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal, TypeAlias, get_args

import numpy as np
from threadpoolctl import threadpool_limits
from tqdm import tqdm

from csm._progress import progress_bar
from csm._types import IntArray
from csm.data.shapeset import Shape
from csm.errors import ConfigError, DataError
from csm.evaluation.distances import MatchedPoints, TargetErrors, target_errors
from csm.evaluation.metrics import FLIP_MARGIN
from csm.evaluation.results import Evaluation, PairErrors, summarise
from csm.mesh.correspondence import ground_truth
from csm.operators.geodesic import Method
from csm.operators.operators import Memo

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


@dataclass(frozen=True)
class Protocol:
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
    """

    pairs: Literal["all"] | Sequence[Pair] = "all"
    sample: int | None = None
    points: int | None = None
    seed: int = 0
    distance: Method = "exact"
    normaliser: Normaliser = "diameter"

    def __post_init__(self) -> None:
        for what, value, known in (
            ("distance", self.distance, get_args(Method)),
            ("normaliser", self.normaliser, get_args(Normaliser)),
        ):
            if value not in known:
                raise ConfigError(f"protocol: {what}={value!r} is unknown; choose one of {', '.join(known)}")
        if isinstance(self.pairs, str) and self.pairs != "all":
            raise ConfigError(f'protocol: pairs={self.pairs!r} is unknown; wanted "all" or a list of name pairs')
        if self.sample is not None and self.sample < 1:
            raise ConfigError(f"protocol: sample={self.sample}; wanted a number of pairs from 1, or none for all")
        if self.points is not None and self.points < 1:
            raise ConfigError(f"protocol: points={self.points}; wanted a number of points from 1, or none for all")

    def choose(self, names: Sequence[str]) -> list[Pair]:
        """Return the (source, target) pairs to evaluate among shapes of these names.

        Examples
        --------
        >>> Protocol().choose(["a", "b"])
        [('a', 'b'), ('b', 'a')]
        """
        if isinstance(self.pairs, str):
            pairs = list(itertools.permutations(names, 2))
        else:
            pairs = [(source, target) for source, target in self.pairs]
        unknown = sorted({name for pair in pairs for name in pair} - set(names))
        if unknown:
            raise DataError(f"the pair list names {unknown[0]!r} and {len(unknown) - 1} more that are not in the set")
        if not pairs:
            raise DataError(f"there is no pair to evaluate: {len(names)} shapes, pairs={self.pairs!r}")
        if self.sample is not None and self.sample < len(pairs):
            kept = np.random.default_rng(self.seed).choice(len(pairs), self.sample, replace=False)
            pairs = [pairs[i] for i in sorted(kept)]
        return pairs

    def _points(self) -> str:
        return "all" if self.points is None else f"those of {self.points} (drawn with seed {self.seed})"

    def describe(self, n_pairs: int | None = None) -> str:
        """Say the protocol in words, for captions and result files.

        Examples
        --------
        >>> Protocol(sample=50, seed=1, distance="edge", normaliser="sqrt_area").describe()[:58]
        '50 pairs (drawn with seed 1 from all ordered pairs without'
        """
        which = "all ordered pairs without self-pairs" if self.pairs == "all" else "a given list of pairs"
        if self.sample is not None:
            which = f"drawn with seed {self.seed} from {which}"
            n_pairs = self.sample if n_pairs is None else n_pairs
        return (
            f"{'' if n_pairs is None else f'{n_pairs} '}pairs ({which}); error = {_DISTANCES[self.distance]} on the "
            f"target from the true to the matched vertex, divided by the {_NORMALISERS[self.normaliser]}; "
            f"mean over {self._points()} template points known on both shapes, pooled over pairs; a match on "
            f"another component counts as one diameter; left-right flip: nearer to the mirrored truth "
            f"by more than {FLIP_MARGIN:g}."
        )


Matcher: TypeAlias = Callable[[Shape, Shape], IntArray]


def evaluate_matches(
    shapes: Sequence[Shape],
    match: Matcher,
    protocol: Protocol,
    progress: bool = True,
    *,
    workers: int = 1,
    memo: Memo | None = None,
) -> Evaluation:
    """Match every pair of the protocol and measure the errors.

    Parameters
    ----------
    shapes
        With unique names.
    match
        Called as ``match(source, target)``, target by target; gives for each vertex of the source a vertex of the
        target, shape (N_source,). Only vertices with known ground truth are looked at; others may be -1.
    protocol
        Which pairs, distance and normaliser.
    progress
        Show a bar with the names of the shapes.
    workers
        Processes of one thread each that measure distances while this one goes on matching; up to 1 measures in this
        process.  More need the caller's script to be importable (``if __name__ == "__main__"``), as with any process
        pool.
    memo
        Such as a store: keeps distances from the protocol's points, if they are few, for the next evaluation on the
        same shapes, whatever is matched then.

    Raises
    ------
    DataError
        If names repeat or are unknown, shapes have no template point in common, or a match has the wrong shape.
    """
    by_name = {shape.name: thinned(shape, protocol) for shape in shapes}
    if len(by_name) != len(shapes):
        raise DataError(f"{len(shapes)} shapes have only {len(by_name)} different names; each needs its own")
    pairs = protocol.choose(list(by_name))
    started = time.perf_counter()
    jobs: dict[str, Future[TargetErrors]] = {}
    asked: dict[str, list[MatchedPoints]] = {}
    with progress_bar(total=len(pairs), unit="pair", disable=not progress) as bar, _pool(workers) as submit:
        for target, sources in _by_target(pairs).items():
            asked[target] = []
            for source in sources:
                bar.set_postfix_str(f"{source} -> {target}")
                asked[target].append(matched_points(by_name[source], by_name[target], match))
            args = by_name[target].mesh, protocol.distance, protocol.normaliser, asked[target], memo
            jobs[target] = submit(target_errors, *args)
            jobs[target].add_done_callback(partial(_advance, bar, len(sources)))
        answers = {target: job.result() for target, job in jobs.items()}
    position = {target: iter(zip(asked[target], answers[target].errors, strict=True)) for target in asked}
    measured = [PairErrors(pair, *next(position[pair[1]]), answers[pair[1]].lengths) for pair in pairs]
    return summarise(measured, protocol, time.perf_counter() - started)


def thinned(shape: Shape, protocol: Protocol) -> Shape:
    """Return the shape with only the points of the protocol known."""
    truth = shape.truth.as_template_to_shape()
    if protocol.points is None or protocol.points >= truth.n_from:
        return shape
    indices = truth.indices.copy()
    indices[np.random.default_rng(protocol.seed).permutation(truth.n_from)[protocol.points :]] = -1
    return replace(shape, truth=replace(truth, indices=indices))


def _by_target(pairs: Sequence[Pair]) -> dict[str, list[str]]:
    sources: dict[str, list[str]] = {}
    for source, target in pairs:
        sources.setdefault(target, []).append(source)
    return sources


def matched_points(source: Shape, target: Shape, match: Matcher) -> MatchedPoints:
    """Return where the template points known on both shapes belong on the target, and where `match` takes them.

    Raises
    ------
    DataError
        If the shapes have no template point in common, or the match has the wrong shape.
    """
    points = ground_truth(source.truth, target.truth)
    matched = np.asarray(match(source, target))
    n, m = source.mesh.n_vertices, target.mesh.n_vertices
    asked = matched[points.source] if matched.shape == (n,) else np.array([-1])
    if matched.dtype.kind not in "iu" or asked.min(initial=0) < 0 or asked.max(initial=0) >= m:
        raise DataError(
            f"{source.name} -> {target.name}: the match is {matched.dtype} of shape {matched.shape}; wanted {n} "
            f"integers in 0..{m - 1}"
        )
    mirror = None
    if target.mirror is not None:
        s, t = source.truth.as_template_to_shape(), target.truth.as_template_to_shape()
        both = (s.indices >= 0) & (t.indices >= 0)
        mirror = target.mirror.as_template_to_shape(t.n_from).indices[both]
    return MatchedPoints(points.target, asked.astype(np.int64), mirror)


def _advance(bar: tqdm[Any], n_pairs: int, _: Future[TargetErrors]) -> None:
    bar.update(n_pairs)


@contextmanager
def _pool(workers: int) -> Iterator[Callable[..., Future[Any]]]:
    if workers <= 1:
        yield _at_once
        return
    with ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        yield lambda *task: pool.submit(_on_one_thread, *task)


def _on_one_thread(function: Callable[..., Any], *args: Any) -> Any:
    with threadpool_limits(1):
        return function(*args)


def _at_once(function: Callable[..., Any], *args: Any) -> Future[Any]:
    done: Future[Any] = Future()
    done.set_result(function(*args))
    return done
