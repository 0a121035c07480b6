"""Table 6: parameters, seconds and memory of every learned method, with ratios to CSMCNN."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from matplotlib.figure import Figure

from csm._parallel import in_fresh_process
from csm._peak import peak_megabytes
from csm._progress import progress_bar
from csm._types import Arrays
from csm.data.prepare import prepare_mesh
from csm.data.store import Store
from csm.descriptors.base import record
from csm.descriptors.presets import preset
from csm.errors import ConfigError
from csm.learning.samples import NetworkInput, ShapeSample, recipe_of, shape_sample
from csm.mesh.correspondence import PointMap
from csm.mesh.shape import Mesh
from csm.networks import build, settings
from csm.reproduction.published import NETWORKS
from csm.reproduction.study import Context, Findings, Rows, Study
from csm.reproduction.timing import BUSY, clocked, measured, timed_mesh
from csm.viewer.comparisons import dots_figure

if TYPE_CHECKING:  # what lists the studies need not wait for Lightning
    from csm.learning.module import CSMModule

REFERENCE = "csmcnn"
"""The method that ratios are taken to."""

COLUMNS = (
    *("method", "input", "parameters", "without classifier", "paper, million"),
    *("train epoch s", "test epoch s", "MB", "train to csmcnn", "test to csmcnn"),
)


@dataclass(frozen=True)
class Table6(Study):
    """Every method on one body; an epoch is so many times one shape.

    Parameters
    ----------
    networks
        Names of `csm.reproduction.published.NETWORKS`.
    vertices
        Of the body, which are also the classes.
    threads
        Of PyTorch.
    repeats
        Measurements, of which the median counts.
    train_shapes, test_shapes
        Of an epoch.
    """

    networks: tuple[str, ...] = tuple(NETWORKS)
    vertices: int = 6890
    threads: int = 2
    repeats: int = 5
    train_shapes: int = 80
    test_shapes: int = 20

    def run(self, context: Context) -> Findings:
        """Measure what is missing; ConfigError if a method is unknown or a number is below 1."""
        unknown = [name for name in self.networks if name not in NETWORKS]
        if unknown or not self.networks:
            wrong = ", ".join(unknown) or "no method"
            raise ConfigError(f"{self.name}: {wrong}; choose out of {', '.join(NETWORKS)}")
        if min(self.vertices, self.threads, self.repeats, self.train_shapes, self.test_shapes) < 1:
            raise ConfigError(f"{self.name}: vertices, threads, repeats and numbers of shapes are from 1")
        mesh, whence = timed_mesh(context, self.vertices)
        costs = {
            name: self._cell(context, name, mesh) for name in progress_bar(self.networks, desc="measure", unit="method")
        }
        rows = [self._row(name, costs) for name in self.networks]
        starved = [NETWORKS[name].title for name, cost in costs.items() if cost["share"] < BUSY]
        notes = (
            f"Body: {whence}, {mesh.n_vertices} vertices, every one a class. {self.threads} threads; medians of "
            f"{self.repeats} after a step to warm up. Training epoch: {self.train_shapes} times forward, loss over all "
            f"vertices, backward and Adam; test epoch: {self.test_shapes} descriptors. Descriptors, bases and stencils "
            "are prepared before and not counted.",
            "MB: peak of the process's memory in training less what it held with the shape loaded.",
            "The classifier serves the training only. MGCN as released has 2.85 million parameters, the paper prints "
            "3.03.",
            *([f"Other work disturbed {', '.join(starved)}."] if starved else []),
        )
        title = "Parameters, seconds per epoch and memory of the learned methods."
        return self.findings(context, title, COLUMNS, rows, notes, _draw(rows))

    def _cell(self, context: Context, name: str, mesh: Mesh) -> dict[str, Any]:
        hparams = hparams_of(name)
        question = {**hparams, "threads": self.threads, "repeats": self.repeats}
        measure = partial(cost_of, hparams, mesh, context.store, self.threads, self.repeats)
        return {key: x.tolist() for key, x in measured(context, "network-cost", mesh, question, measure).items()}

    def _row(self, name: str, costs: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
        setting, cost, reference = NETWORKS[name], costs[name], costs.get(REFERENCE)
        train, test = (float(np.median(cost[kind])) for kind in ("train", "test"))
        megabytes = None if np.isnan(cost["megabytes"]) else cost["megabytes"]
        return {
            "name": name,
            "method": setting.title,
            "input": setting.descriptor,
            "parameters": cost["parameters"],
            "without classifier": cost["parameters"] - cost["classifier"],
            "paper, million": setting.paper_millions,
            "train epoch s": self.train_shapes * train,
            "test epoch s": self.test_shapes * test,
            "MB": None if megabytes is None else round(megabytes),
            "train to csmcnn": None if reference is None else train / float(np.median(reference["train"])),
            "test to csmcnn": None if reference is None else test / float(np.median(reference["test"])),
            "measurements": {**cost, "megabytes": megabytes},
        }


def hparams_of(name: str) -> dict[str, Any]:
    """Return network, descriptor and number of eigenpairs of a method as its checkpoint would hold them."""
    network = settings(NETWORKS[name].model)
    with torch.device("meta"):
        basis_k = build(in_channels=1, n_classes=1, **network).n_eigenpairs
    return {"network": network, "descriptor": record(preset(NETWORKS[name].descriptor)), "basis_k": basis_k}


def cost_of(hparams: Mapping[str, Any], mesh: Mesh, store: Store, threads: int, repeats: int) -> Arrays:
    """Measure a network on a mesh whose every vertex is a class, in a fresh process, after one step to warm up.

    Descriptor, basis and stencils come from the store, or go there first.

    Returns
    -------
    Arrays
        Numbers of weights, of all "parameters" and of the "classifier", which is not needed to match; seconds of one
        step of training, "train", and of one descriptor, "test", one number per repeat; processor time over clock time
        of all steps, "share", which is about the number of threads at work; and "megabytes", the peak of the process's
        memory in training less its peak before the network was made, NaN on Windows.
    """
    prepare_mesh(mesh, recipe_of(hparams), store)
    return in_fresh_process(_measure, hparams, mesh, str(store.root), threads, repeats)


def _measure(hparams: Mapping[str, Any], mesh: Mesh, root: str, threads: int, repeats: int) -> Arrays:
    from csm.learning.module import CSMModule

    torch.set_num_threads(threads)
    torch.manual_seed(0)
    prepared = prepare_mesh(mesh, recipe_of(hparams), Store(root))
    sample = shape_sample(prepared, PointMap.identity(mesh.n_vertices))
    given = NetworkInput(sample.features, sample.surface)
    before = peak_megabytes()
    module = CSMModule(in_channels=sample.features.shape[1], n_classes=mesh.n_vertices, **hparams)
    optimizer = torch.optim.Adam(module.parameters())
    _step(module, optimizer, sample)
    train = clocked(lambda _: _step(module, optimizer, sample), range(repeats))
    test = clocked(lambda _: module.describe(given), range(repeats))
    weights = {name: p.numel() for name, p in module.network.named_parameters()}
    found = {
        "parameters": sum(weights.values()),
        "classifier": sum(n for name, n in weights.items() if name.startswith("classifier.")),
        "train": train["wall"],
        "test": test["wall"],
        "share": (train["cpu"].sum() + test["cpu"].sum()) / (train["wall"].sum() + test["wall"].sum()),
        "megabytes": peak_megabytes() - before,
    }
    return {key: np.asarray(value) for key, value in found.items()}


def _step(module: CSMModule, optimizer: torch.optim.Optimizer, sample: ShapeSample) -> None:
    module.train()
    optimizer.zero_grad()
    module.loss(module(sample.features, sample.surface), sample).backward()  # type: ignore[no-untyped-call]
    optimizer.step()


def _draw(rows: Rows) -> Figure:
    panels = {
        "parameters (million)": [row["parameters"] / 1e6 for row in rows],
        "training epoch (s)": [row["train epoch s"] for row in rows],
        "test epoch (s)": [row["test epoch s"] for row in rows],
        "peak memory (MB)": [float("nan") if row["MB"] is None else row["MB"] for row in rows],
    }
    return dots_figure([row["method"] for row in rows], {label: {"": values} for label, values in panels.items()})
