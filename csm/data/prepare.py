"""Fill the store with eigenbases, descriptors and stencils of many shapes, in parallel and resumable."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from csm._parallel import n_processes, parallel_map
from csm._signals import saying
from csm._types import Arrays, Float32Array, FloatArray
from csm.data.shapes import ShapeSet
from csm.data.store import Store
from csm.descriptors.base import Descriptor, record
from csm.descriptors.stack import Stack
from csm.errors import CsmError, MeshError
from csm.mesh.check import require_usable
from csm.mesh.debris import body_of, unit_area
from csm.mesh.shape import Mesh
from csm.operators import Operators, Spectrum
from csm.operators.stencils import Stencil

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Recipe:
    """What a method needs to know of every shape.

    Parameters
    ----------
    descriptor
        Gives the features.
    basis_k
        How many Laplace-Beltrami eigenpairs are kept; 0 for none.
    stencils
        What else a network needs.
    """

    descriptor: Descriptor
    basis_k: int = 128
    stencils: tuple[Stencil, ...] = ()


@dataclass(frozen=True, eq=False)
class Prepared:
    """A mesh with its features, shape (N, Q), and of its unit-area copy vertex areas (N,), eigenbasis and stencils."""

    mesh: Mesh
    features: Float32Array
    mass: FloatArray
    basis: Spectrum | None
    stencils: Mapping[str, Arrays] = field(default_factory=dict)


@dataclass(frozen=True)
class Job:
    """One shape of one set, to be prepared."""

    shapes: ShapeSet
    name: str

    @property
    def label(self) -> str:
        """Set and shape, for messages."""
        return f"{self.shapes.name}/{self.name}"


@dataclass
class Summary:
    """What a preparation did: how many shapes the store had, how many were computed, and which failed and why."""

    present: int = 0
    made: int = 0
    failures: list[tuple[str, str]] = field(default_factory=list)
    seconds: float = 0.0

    def table(self) -> str:
        """Return the failures as aligned text, one line each."""
        width = max((len(label) for label, _ in self.failures), default=0)
        return "\n".join(f"{label:<{width}}  {why}" for label, why in self.failures)


class _Bases:
    """A memo that keeps the eigenbases of some sizes in the store; other spectra last as long as their operators."""

    def __init__(self, store: Store, sizes: frozenset[int]) -> None:
        self._store, self._sizes = store, sizes

    def fetch(self, kind: str, mesh: Mesh, params: Mapping[str, Any], make: Callable[[], Arrays]) -> Arrays:
        kept = kind == "lbo" and params["k"] in self._sizes
        return self._store.fetch(kind, mesh, params, make) if kept else make()


def shared_operators(mesh: Mesh, recipes: Sequence[Recipe], store: Store) -> Operators:
    """Return operators of a mesh at unit area from which all these recipes are computed, with shared eigenproblems."""
    return Operators(mesh, memo=_Bases(store, frozenset(recipe.basis_k for recipe in recipes)))


def features_of(mesh: Mesh, descriptor: Descriptor, store: Store, operators: Operators | None = None) -> Float32Array:
    """Return the descriptor of a mesh, shape (N, Q), from the store or computed and kept.

    Parameters
    ----------
    mesh
        The shape, at any scale.
    descriptor
        It is looked up, and kept, by its parameters; of a stack each part by itself.
    store
        Where it is kept.
    operators
        Of the mesh at unit area, so that several descriptors share their eigenpairs.
    """
    if isinstance(descriptor, Stack):
        return np.hstack([features_of(mesh, part, store, operators) for part in descriptor.parts.values()])

    def make() -> dict[str, Float32Array]:
        if operators is None:
            require_usable(mesh)
        return {"values": descriptor(operators or mesh).values.astype(np.float32)}

    values: Float32Array = store.fetch("descriptor", mesh, _key(mesh, descriptor), make)["values"]
    return values


def _key(mesh: Mesh, descriptor: Descriptor) -> dict[str, Any]:
    """Return what a descriptor is looked up by; what is treated otherwise than in version 0.1 has another key."""
    body, key = body_of(mesh), record(descriptor)
    if body.n_debris:
        key["without"] = "debris"
    if descriptor.by_component and body.n_components > 1:
        key["by"] = "component"
    return key


def prepare_mesh(mesh: Mesh, recipe: Recipe, store: Store, operators: Operators | None = None) -> Prepared:
    """Return one mesh with features, basis and stencils; what the store lacks is computed and kept there.

    Parameters
    ----------
    mesh, recipe, store
        The shape, what to compute, and where it is kept.
    operators
        From `shared_operators`, if other recipes are computed for the same mesh.
    """
    operators = operators or shared_operators(mesh, [recipe], store)
    if recipe.basis_k > recipe.descriptor.eigenpairs:
        operators.lbo(recipe.basis_k)  # first, so that the descriptor takes its eigenpairs from these
    features = features_of(mesh, recipe.descriptor, store, operators)
    basis = operators.lbo(recipe.basis_k) if recipe.basis_k else None
    unit = operators.mesh
    if recipe.stencils and operators.body is not None:
        raise MeshError(
            f"{mesh.label}: {body_of(mesh).note}; a network with {recipe.stencils[0].name} cannot leave them out by "
            "itself: use clean=auto, or csm clean first"
        )
    stencils = {
        s.name: store.fetch(f"stencil-{s.name}", unit, s.parameters(), partial(s, operators)) for s in recipe.stencils
    }
    return Prepared(mesh, features, operators.mass if basis is None else basis.mass, basis, stencils)


def is_prepared(mesh: Mesh, recipe: Recipe, store: Store) -> bool:
    """Tell whether `prepare_mesh` would find everything in the store; nothing is read."""
    parts = recipe.descriptor.parts.values() if isinstance(recipe.descriptor, Stack) else [recipe.descriptor]
    if not all(store.has("descriptor", mesh, _key(mesh, part)) for part in parts):
        return False
    if not recipe.basis_k and not recipe.stencils:
        return True
    unit = unit_area(mesh)
    return (not recipe.basis_k or store.has("lbo", unit, {"k": recipe.basis_k})) and all(
        store.has(f"stencil-{s.name}", unit, s.parameters()) for s in recipe.stencils
    )


def prepare(
    jobs: Sequence[Job],
    recipes: Sequence[Recipe],
    store: Store,
    *,
    workers: int | None = None,
    progress: bool = True,
) -> Summary:
    """Fill the store for many shapes.  Entries that exist are not computed again, so a killed run can be restarted.

    All recipes of a shape share its eigenproblems.  Entries that exist are not read either; a fault inside one is found
    when it is loaded, and the entry is computed again then.

    Parameters
    ----------
    jobs
        The shapes.
    recipes
        What to compute for each.
    store
        Where the results are kept.
    workers
        Processes, each with one BLAS thread; see `csm._parallel.n_processes`.
    progress
        Show a progress bar with the shape's name and the estimated time left.

    Returns
    -------
    Summary
        Failures are listed there, not raised.

    Raises
    ------
    KeyboardInterrupt
        When it is stopped by Ctrl-C or, within `csm._signals.terminable`, by SIGTERM; says what is kept.
    """
    begun = time.perf_counter()
    one = partial(_prepare_one, recipes=tuple(recipes), root=str(store.root))
    count = n_processes(workers, len(jobs))
    kept: list[str] = []
    with saying(lambda: _what_is_kept(kept, len(jobs))):
        done = parallel_map(
            one,
            jobs,
            lambda job: job.label,
            count,
            what="prepare",
            unit="shape",
            progress=progress,
            on_result=lambda result: kept.append(result[0]),
        )
    states = [state for state, _ in done]
    failures = [(job.label, why) for job, (state, why) in zip(jobs, done, strict=True) if state == "failed"]
    return Summary(states.count("present"), states.count("made"), failures, time.perf_counter() - begun)


def _what_is_kept(states: Sequence[str], n_jobs: int) -> str:
    kept = len(states) - states.count("failed")
    return f"{kept} of {n_jobs} shapes are in the store; run the same command again to go on"


def _prepare_one(job: Job, recipes: Sequence[Recipe], root: str) -> tuple[str, str]:
    """Prepare one shape in a worker; return what happened ("present", "made" or "failed") and why."""
    store = Store(root)
    try:
        _prepare_missing(job.shapes.load(job.name).mesh, recipes, store)
    except CsmError as error:
        return "failed", str(error)
    except Exception as error:  # one bad shape must not end the run; the table of failures names it
        _log.exception("%s", job.label)
        return "failed", f"{type(error).__name__}: {error}"
    return ("made" if store.computed else "present"), ""


def _prepare_missing(mesh: Mesh, recipes: Sequence[Recipe], store: Store) -> None:
    missing = [recipe for recipe in recipes if not is_prepared(mesh, recipe, store)]
    if not missing:
        return
    operators = shared_operators(mesh, missing, store)
    for recipe in sorted(missing, key=_eigenpairs, reverse=True):  # the largest spectrum serves the others
        prepare_mesh(mesh, recipe, store, operators)


def _eigenpairs(recipe: Recipe) -> int:
    return max(recipe.descriptor.eigenpairs, recipe.basis_k)
