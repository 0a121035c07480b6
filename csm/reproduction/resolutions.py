"""Figure 2 and stability: what changes when one shape is given in several triangulations, eigenvalues and descriptors.

A descriptor that is the same everywhere does not change at all, so its change stands beside what separates different
points (`contrast`), and beside the error of matching the two triangulations by nearest neighbours.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from csm._types import Float32Array, FloatArray
from csm.data.shapes import InMemory, Shape
from csm.errors import ConfigError, DataError
from csm.mesh.correspondence import GroundTruth, ground_truth
from csm.mesh.shape import Mesh
from csm.operators import Operators
from csm.reproduction.bodies import Bodies, OnBodies, Source, describe, find_bodies
from csm.reproduction.published import label
from csm.reproduction.study import Context, Findings, OnPoints, Study
from csm.viewer.comparisons import dots_figure
from csm.viewer.spectra import deviation, resolutions_figure

_ORIGINAL = "original"
_AXES = {"contrast": "change / distance of random points", "error": "matching error (thousandths of the diameter)"}


@dataclass(frozen=True)
class Figure2(Study):
    """The spectra of one body in all its triangulations.

    Parameters
    ----------
    source
        Of the bodies; see `csm.reproduction.bodies.find_bodies`.
    alpha
        Strength of the anisotropic Laplacians.
    degrees
        Their angles.
    k
        Number of eigenvalues, from 2.
    """

    source: Source | Bodies = "auto"
    alpha: float = 10.0
    degrees: tuple[float, ...] = (0.0, 45.0, 90.0, 135.0)
    k: int = 100

    def run(self, context: Context) -> Findings:
        """Compute and draw; ConfigError if `k` is below 2."""
        if self.k < 2:
            raise ConfigError(f"{self.name}: k={self.k}; wanted at least 2 eigenvalues, the first is zero")
        bodies = find_bodies(self.source, context)
        meshes = {title: shapes.load(bodies.body).mesh for title, shapes in bodies.resolutions.items()}
        by_mesh = {title: self._spectra(mesh, context) for title, mesh in meshes.items()}
        finest = max(meshes, key=lambda title: meshes[title].n_vertices)
        spectra = {operator: {title: by_mesh[title][operator] for title in meshes} for operator in by_mesh[finest]}
        rows = []
        for operator, lines in spectra.items():
            for title, evals in lines.items():
                change = np.abs(deviation(evals, lines[finest]))
                changes = {"mean change %": float(change.mean()), "largest change %": float(change.max())}
                rows.append({"operator": operator, "mesh": title, **changes, "eigenvalues": evals.tolist()})
        note = (
            f"Changes are relative to the finest mesh, {finest}, over the {self.k - 1} eigenvalues above zero; every "
            "mesh is scaled to unit area. Refined meshes keep the original vertices and add others on the surface."
        )
        where = f"{bodies.title}, {bodies.body}; alpha {self.alpha:g}"
        title = f"Eigenvalues of one shape at several resolutions ({where})."
        shown = ("operator", "mesh", "mean change %", "largest change %")
        return self.findings(context, title, shown, rows, (note,), resolutions_figure(spectra, finest))

    def _spectra(self, mesh: Mesh, context: Context) -> dict[str, FloatArray]:
        operators = Operators(mesh, memo=context.store)
        radians = {f"anisotropic, {angle:g}°": float(np.radians(angle)) for angle in self.degrees}
        turned = {title: operators.albo(self.alpha, theta, self.k).evals for title, theta in radians.items()}
        return {"isotropic": operators.lbo(self.k).evals, **turned}


@dataclass(frozen=True)
class Stability(OnPoints, OnBodies):
    """The descriptors of one body in its own and all its other triangulations; changes are measured at all points."""

    points: int = 500

    def run(self, context: Context) -> Findings:
        """Measure and draw; DataError if there is no other triangulation over the same template."""
        bodies = find_bodies(self.source, context)
        original = bodies.original.load(bodies.body)
        others = {title: shapes.load(bodies.body) for title, shapes in bodies.corresponding.items()}
        if not others:
            raise DataError(f"{self.name}: no other triangulation of {bodies.title} has the same template")
        shapes = InMemory({_ORIGINAL: original, **others}, self.name)
        found = self.evaluate(context, self.descriptors, shapes, [(_ORIGINAL, title) for title in others])
        errors = {(e.method, row.target): 1000 * row.age for e in found for row in e.rows}
        changes = self._changes(context, original, others)
        rows = [
            {"descriptor": name, "mesh": title, **changes[name, title], "error": errors[name, title]}
            for name in self.descriptors
            for title in others
        ]
        panels = {
            text: {title: [row[quantity] for row in rows if row["mesh"] == title] for title in others}
            for quantity, text in _AXES.items()
        }
        return self.findings(
            context,
            f"Descriptors of one point of one shape in two triangulations ({bodies.title}, {bodies.body}).",
            ("descriptor", "mesh", "change", "contrast", "error"),
            rows,
            (
                f"From {original.mesh.n_vertices:,} vertices to each other mesh. The refined meshes have the vertices "
                "of the original first, so a point is the same point exactly; on a remeshed one it is the nearest "
                "vertex.",
                "change: median over points of |f - f'| / |f|. contrast: mean |f - f'| over the mean distance between "
                "the descriptors of two random points of the original; below 1 points can be told apart at all.",
                f"error: mean geodesic error of nearest-neighbour matching of {self.points} points onto the other "
                "mesh, in thousandths of its diameter.",
            ),
            dots_figure([label(name) for name in self.descriptors], panels),
        )

    def _changes(
        self, context: Context, original: Shape, others: Mapping[str, Shape]
    ) -> dict[tuple[str, str], dict[str, Any]]:
        """Return by descriptor and triangulation how much it changes."""
        here, found = describe(original.mesh, self.descriptors, context.store), {}
        for title, shape in others.items():
            pairs = ground_truth(original.truth, shape.truth)
            for name, there in describe(shape.mesh, self.descriptors, context.store).items():
                found[name, title] = change_of(here[name], there, pairs, context.seed)
        return found


def change_of(here: Float32Array, there: Float32Array, pairs: GroundTruth, seed: int) -> dict[str, float]:
    """Measure the change of descriptors at corresponding points (P), relative to their length and to chance."""
    f, g = here[pairs.source].astype(np.float64), there[pairs.target].astype(np.float64)
    gap, length = np.linalg.norm(f - g, axis=1), np.linalg.norm(f, axis=1)
    stranger = np.random.default_rng(seed).permutation(len(f))
    apart = float(np.linalg.norm(f - f[stranger], axis=1).mean())
    known = length > 0
    return {
        "change": float(np.median(gap[known] / length[known])) if known.any() else 0.0,
        "contrast": float(gap.mean()) / apart if apart > 0 else 1.0,
    }
