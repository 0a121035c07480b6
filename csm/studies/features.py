"""Many descriptors of many shapes in the store, those of one shape made from the same eigenpairs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from csm._processes import run_all
from csm._types import Float32Array
from csm.data.prepare import compute_features
from csm.data.shapeset import ShapeSet
from csm.data.store import Store
from csm.descriptors.base import Descriptor, eigenpairs
from csm.errors import CsmError
from csm.mesh.shape import Mesh
from csm.operators.operators import Operators


@dataclass(frozen=True, eq=False)
class _Task:
    shapes: ShapeSet
    name: str
    descriptors: tuple[Descriptor, ...]
    store: Store


def fill(
    shapes: ShapeSet, names: Sequence[str], descriptors: Sequence[Descriptor], store: Store, workers: int
) -> dict[str, str]:
    """Put descriptors of shapes into the store, as far as they are not there; return which shapes failed and why.

    The descriptors of a shape share its eigenpairs, which are not kept.

    Parameters
    ----------
    shapes, names
        The shapes.
    descriptors
        Each is looked up, and kept, by its parameters.
    store
        Where they go.
    workers
        Processes of one thread.
    """
    tasks = [_Task(shapes, name, tuple(descriptors), store) for name in names]
    reasons = run_all(_fill, tasks, lambda task: task.name, workers, what=f"describe {shapes.name}", unit="shape")
    return {name: why for name, why in zip(names, reasons, strict=True) if why}


def describe(mesh: Mesh, descriptors: Sequence[Descriptor], store: Store) -> list[Float32Array]:
    """Return descriptors of a mesh, each (N, Q), from the store or computed on shared operators and kept."""
    operators = Operators(mesh)
    order = sorted(range(len(descriptors)), key=lambda at: eigenpairs(descriptors[at]), reverse=True)
    values = {at: compute_features(mesh, descriptors[at], store, operators) for at in order}
    return [values[at] for at in range(len(descriptors))]


def _fill(task: _Task) -> str:
    try:
        describe(task.shapes.load(task.name).mesh, task.descriptors, task.store)
    except CsmError as error:
        return str(error)
    return ""
