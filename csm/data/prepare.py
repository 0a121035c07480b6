"""Fill the store: eigenbases and descriptors of many shapes, in parallel, resumable."""

from __future__ import annotations

import logging
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from csm._processes import processes, run_all
from csm._types import Arrays, Float32Array
from csm.data.shapeset import Shape, ShapeSet
from csm.data.store import Store
from csm.descriptors.base import Descriptor, record
from csm.errors import CsmError
from csm.mesh.check import require_usable
from csm.mesh.shape import Mesh
from csm.operators.operators import Operators
from csm.operators.spectrum import Spectrum
from csm.operators.stencils import Stencil

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Recipe:
    """What a network wants to know of every shape.

    Parameters
    ----------
    descriptor
        Gives the input features.
    basis_k
        How many Laplace-Beltrami eigenpairs are kept.
    stencils
        What else it wants to know.
    """

    descriptor: Descriptor
    basis_k: int = 128
    stencils: tuple[Stencil, ...] = ()


@dataclass(frozen=True, eq=False)
class Prepared:
    """A shape with its features, shape (N, Q), and of its unit-area copy the eigenbasis and the stencils by name."""

    shape: Shape
    features: Float32Array
    basis: Spectrum
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
    """What a preparation did: how many shapes were already there, made, or failed, and why."""

    present: int = 0
    made: int = 0
    failures: list[tuple[str, str]] = field(default_factory=list)
    seconds: float = 0.0

    def table(self) -> str:
        """Return the failures as aligned text, one line each."""
        width = max((len(label) for label, _ in self.failures), default=0)
        return "\n".join(f"{label:<{width}}  {why}" for label, why in self.failures)


def compute_features(
    mesh: Mesh, descriptor: Descriptor, store: Store, operators: Operators | None = None
) -> Float32Array:
    """Return the descriptor of a mesh, shape (N, Q), from the store or computed and kept.

    `operators` of the mesh at unit area may be given, so that several descriptors share their eigenpairs.
    """

    def make() -> dict[str, Float32Array]:
        require_usable(mesh)
        return {"values": descriptor(operators or mesh).values.astype(np.float32)}

    values: Float32Array = store.fetch("descriptor", mesh, record(descriptor), make)["values"]
    return values


def prepare_shape(shape: Shape, recipe: Recipe, store: Store) -> Prepared:
    """Return one shape with features and basis, from the store where they are there."""
    features = compute_features(shape.mesh, recipe.descriptor, store)
    operators = Operators(shape.mesh, memo=store)
    basis = operators.lbo(recipe.basis_k)  # before a stencil asks for more pairs, or the store would never hold these
    stencils = {s.name: _arrays_of(s, operators, store) for s in recipe.stencils}
    return Prepared(shape, features, basis, stencils)


def _arrays_of(stencil: Stencil, operators: Operators, store: Store) -> Arrays:
    return store.fetch(f"stencil-{stencil.name}", operators.mesh, stencil.parameters(), lambda: stencil(operators))


def is_prepared(mesh: Mesh, recipe: Recipe, store: Store) -> bool:
    """Tell whether `prepare_shape` would find everything in the store; nothing is read."""
    unit = mesh.unit_area()
    return (
        store.has("descriptor", mesh, record(recipe.descriptor))
        and store.has("lbo", unit, {"k": recipe.basis_k})
        and all(store.has(f"stencil-{s.name}", unit, s.parameters()) for s in recipe.stencils)
    )


def _prepare_one(job: Job, recipe: Recipe, root: str) -> tuple[str, str]:
    """Prepare one shape in a worker; return what happened ("present", "made" or "failed") and why."""
    store = Store(root)
    try:
        shape = job.shapes.load(job.name)
        if not is_prepared(shape.mesh, recipe, store):
            prepare_shape(shape, recipe, store)
    except CsmError as error:
        return "failed", str(error)
    except Exception as error:  # one bad shape must not end the run; the table at the end names it
        _log.exception("%s", job.label)
        return "failed", f"{type(error).__name__}: {error}"
    return ("made" if store.computed else "present"), ""


def prepare(
    jobs: Sequence[Job], recipe: Recipe, store: Store, *, workers: int | None = None, progress: bool = True
) -> Summary:
    """Fill the store for many shapes; what is there already is skipped, so a killed run is simply started again.

    Entries that are there are not read, as whoever loads them will; one with a fault inside is computed again then.

    Parameters
    ----------
    jobs
        The shapes.
    recipe
        What to compute for each.
    store
        Where it goes.
    workers
        Processes, each with one BLAS thread; see `csm._processes.processes`.
    progress
        Show a progress bar with the shape's name and the estimated time left.

    Returns
    -------
    Summary
        Failures are listed there, not raised.
    """
    begun = time.perf_counter()
    one = partial(_prepare_one, recipe=recipe, root=str(store.root))
    count = processes(workers, len(jobs))
    done = run_all(one, jobs, lambda job: job.label, count, what="prepare", unit="shape", progress=progress)
    states = [state for state, _ in done]
    failures = [(job.label, why) for job, (state, why) in zip(jobs, done, strict=True) if state == "failed"]
    return Summary(states.count("present"), states.count("made"), failures, time.perf_counter() - begun)
