"""Seconds and memory of a network on one shape, in a process of its own with a given number of threads."""

from __future__ import annotations

import multiprocessing
import sys
import time
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch

from csm.data.datamodule import ShapeSample, to_sample
from csm.data.prepare import Recipe, prepare_shape
from csm.data.shapeset import Shape
from csm.data.store import Store
from csm.descriptors.presets import preset
from csm.learning.meshes import stencils_for
from csm.learning.module import CSMModule
from csm.mesh.correspondence import PointMap
from csm.mesh.shape import Mesh
from csm.studies.contenders import Contender


@dataclass(frozen=True)
class Cost:
    """What a network costs.

    Parameters
    ----------
    parameters, classifier
        Numbers of weights: all, and those of the classifier, which is not needed to match.
    train, test
        Seconds of one training step (forward, loss, backward, Adam) and of one descriptor, one number per repeat.
    share
        Processor time over clock time of all steps, about the number of threads that were at work.
    megabytes
        Peak of the process's memory in training less its peak before the network was made; None on Windows.
    """

    parameters: int
    classifier: int
    train: tuple[float, ...]
    test: tuple[float, ...]
    share: float
    megabytes: float | None

    @classmethod
    def from_plain(cls, content: Mapping[str, Any]) -> Cost:
        """Return the cost that `dataclasses.asdict` and json made plain data of."""
        return cls(**{**content, "train": tuple(content["train"]), "test": tuple(content["test"])})

    @property
    def seconds(self) -> float:
        """Median of a training step."""
        return float(np.median(self.train))

    @property
    def test_seconds(self) -> float:
        """Median of a descriptor."""
        return float(np.median(self.test))


def cost_of(contender: Contender, mesh: Mesh, store: Store, threads: int, repeats: int) -> Cost:
    """Measure a network on a mesh whose every vertex is a class, in a fresh process, after one step to warm up.

    Descriptor, basis and stencils come from the store, or go there first.
    """
    shape = Shape(mesh, PointMap.identity(mesh.n_vertices))
    prepare_shape(shape, _recipe(contender), store)
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        return pool.submit(_measure, contender, shape, str(store.root), threads, repeats).result()


def _recipe(contender: Contender) -> Recipe:
    stencils = stencils_for({"name": contender.network, **contender.options})
    return Recipe(preset(contender.descriptor), contender.basis_k, stencils)


def _measure(contender: Contender, shape: Shape, root: str, threads: int, repeats: int) -> Cost:
    torch.set_num_threads(threads)
    torch.manual_seed(0)
    sample = to_sample(prepare_shape(shape, _recipe(contender), Store(root)))
    before = _peak_megabytes()
    module = CSMModule(
        {"name": contender.network, **contender.options},
        in_channels=sample.features.shape[1],
        n_classes=shape.mesh.n_vertices,
        descriptor={},
        basis_k=contender.basis_k,
    )
    optimizer = torch.optim.Adam(module.parameters())
    _step(module, optimizer, sample)
    clock, work = time.perf_counter(), time.process_time()
    train = [_seconds(lambda: _step(module, optimizer, sample)) for _ in range(repeats)]
    test = [_seconds(lambda: module.describe(sample)) for _ in range(repeats)]
    share = (time.process_time() - work) / (time.perf_counter() - clock)
    weights = {name: p.numel() for name, p in module.network.named_parameters()}
    last = sum(n for name, n in weights.items() if name.startswith("classifier."))
    after = _peak_megabytes()
    more = None if before is None or after is None else after - before
    return Cost(sum(weights.values()), last, tuple(train), tuple(test), share, more)


def _step(module: CSMModule, optimizer: torch.optim.Optimizer, sample: ShapeSample) -> None:
    module.train()
    optimizer.zero_grad()
    module.loss(module(sample.features, sample.surface), sample).backward()  # type: ignore[no-untyped-call]
    optimizer.step()


def _seconds(run: Any) -> float:
    begun = time.perf_counter()
    run()
    return time.perf_counter() - begun


def _peak_megabytes() -> float | None:
    if sys.platform == "win32":
        return None  # it has no such count
    import resource

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (2**20 if sys.platform == "darwin" else 2**10)
