"""Figures 10, 12, 13: where descriptors and networks err on a body, and when the target is noisy, cut or glued."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from scipy.spatial import cKDTree

from csm._types import FloatArray
from csm.descriptors.presets import preset
from csm.errors import ConfigError
from csm.evaluation.protocol import EvaluationProtocol
from csm.evaluation.results import Evaluation
from csm.evaluation.targets import Perturbation
from csm.matching.methods import DescriptorMethod, Method
from csm.matching.network import NetworkMethod, load_model
from csm.mesh.perturb import Damaged, grown_together, with_noise, without_part
from csm.mesh.shape import Mesh
from csm.operators.geodesic import Method as Distance
from csm.reproduction.bodies import Bodies, OnBodies, find_bodies
from csm.reproduction.published import label, row_title
from csm.reproduction.study import MEAN_ERROR, Context, Findings, OnPoints
from csm.viewer.camera import View
from csm.viewer.colors import ERROR_COLORMAP
from csm.viewer.comparisons import dots_figure
from csm.viewer.grid import Panel, Scale, scalar_grid
from csm.viewer.style import line_style, new_figure

NEAR = 0.05
"""How far, in units of sqrt(area), a picture takes an error over to vertices without a counterpart."""

TESTED = 20
"""The last so many bodies, which no network was trained on."""

Row = dict[str, Any]


@dataclass(frozen=True)
class OnBodiesWithNetworks(OnBodies):
    """A study of descriptors and trained networks.

    Parameters
    ----------
    checkpoints
        Name -> file of a trained network.  None takes, from the cells of the learned tables in the folder of artefacts,
        the networks of seed 0 that were trained on these bodies.
    """

    descriptors: tuple[str, ...] = ("acd", "acd_paper", "hks")
    checkpoints: Mapping[str, str] | None = None

    def methods(self, context: Context, bodies: Bodies) -> list[Method]:
        """Return presets of descriptors by their labels, and trained networks by the names that they are given.

        ConfigError if there is none or a preset is unknown, DataError if a checkpoint cannot be read.
        """
        if not (found := self.optional_methods(context, bodies)):
            raise ConfigError(
                "there is nothing to compare: name a descriptor, or a checkpoint as checkpoints={NAME:PATH}"
            )
        return found

    def optional_methods(self, context: Context, bodies: Bodies) -> list[Method]:
        """Return the same, also if there is none."""
        found: list[Method] = [DescriptorMethod(preset(name), label(name)) for name in self.descriptors]
        if self.checkpoints is None:
            return found + trained_on(bodies.original.name, context.out)
        return found + [load_model(path, name) for name, path in self.checkpoints.items()]


def trained_on(name: str, out: Path) -> list[NetworkMethod]:
    """Return the networks of seed 0 in the cells of learned tables that were trained on the set of this name.

    Only methods with a title count, so that an ablation's many settings of one method do not come along.
    """
    paths = {path.parent.parent.name: path for path in sorted(out.glob("*/*/seed0/model.ckpt"))}
    found = [load_model(path, row_title(row)) for row, path in paths.items() if row_title(row) != row]
    return [method for method in found if method.training["set"] == name]


@dataclass(frozen=True)
class Figure10(OnBodiesWithNetworks):
    """One person matched onto another within every triangulation, with the error of every vertex.

    Parameters
    ----------
    distance
        Kind of geodesic distance of the errors.  Paths along edges are about 5 % too long, which no colour shows; exact
        distances from every vertex would take an hour where methods miss.
    high
        Error, as a fraction of the diameter, at the upper end of the colours.
    size
        Width and height of a panel in pixels.
    """

    descriptors: tuple[str, ...] = ("acd",)
    distance: Distance = "edge"
    high: float = 0.1
    size: tuple[int, int] = (200, 310)

    def run(self, context: Context) -> Findings:
        """Measure and draw; ConfigError if `high` is not positive."""
        if not self.high > 0:
            raise ConfigError(f"{self.name}: high={self.high}; wanted an error above 0")
        bodies = find_bodies(self.source, context)
        methods = self.methods(context, bodies)
        protocol = EvaluationProtocol([(bodies.body, bodies.other_person)], distance=self.distance)
        rows: dict[str, list[Row]] = {method.name: [] for method in methods}
        grid: dict[str, list[Panel]] = {method.name: [] for method in methods}
        for title, shapes in bodies.resolutions.items():
            mesh = shapes.load(bodies.body).mesh.unit_area()  # so that all triangulations are drawn of one size
            for e in context.evaluate(methods, shapes, protocol, keep_pairs=True):
                values = np.full(mesh.n_vertices, np.nan)
                values[e.pairs[0].points.source] = e.errors  # several points of the template may lie on one vertex
                rows[e.method].append({"method": e.method, "mesh": title, **_at_vertices(values)})
                grid[e.method].append(Panel(mesh, filled(mesh, values)))
        scale = Scale("geodesic error (fraction of the diameter)", self.high, ERROR_COLORMAP)
        return self.findings(
            context,
            f"{bodies.body} matched onto {bodies.other_person} ({bodies.title}), thousandths of the diameter.",
            ("method", "mesh", "error", "95th percentile", "exact %"),
            [row for of_method in rows.values() for row in of_method],
            (
                f"Errors at all vertices with a known counterpart, {self.distance} distances on the target, drawn on "
                "the body that is matched. A vertex without a counterpart looks like the nearest one that has one "
                f"within {NEAR} sqrt(area), and is grey beyond. Both bodies are triangulated alike in every column.",
                "The paper's own figure could not be seen, so this is what we take it for: errors across resolutions.",
            ),
            scalar_grid(grid, list(bodies.resolutions), scale, view=View(up=bodies.up), size=self.size),
        )


def filled(mesh: Mesh, values: FloatArray) -> FloatArray:
    """Give vertices without a value (NaN), on a mesh of unit area, that of the nearest known one up to `NEAR`."""
    known = np.flatnonzero(np.isfinite(values))
    distances, places = cKDTree(mesh.vertices[known]).query(mesh.vertices)
    return np.where(distances <= NEAR, values[known[places]], np.nan)


def _at_vertices(values: FloatArray) -> Row:
    errors = values[np.isfinite(values)]
    return {
        "error": 1000 * float(errors.mean()),
        "95th percentile": 1000 * float(np.percentile(errors, 95)),
        "exact %": 100 * float((errors == 0).mean()),
    }


@dataclass(frozen=True)
class _OnChangedBodies(OnPoints, OnBodiesWithNetworks):
    """A study of how matching suffers when the target is changed.

    Errors are measured on the target as it was, at the points that are left of it, so that changes can be compared.

    Parameters
    ----------
    n_pairs
        Ordered pairs of test bodies, drawn without replacement.
    """

    n_pairs: int = 20

    def rows(self, context: Context, bodies: Bodies, changes: Mapping[str, Perturbation]) -> list[Row]:
        """Match whole bodies onto changed ones by every method; one row per change and method, in this order.

        A method that cannot describe a changed mesh is given the reason in its row instead of numbers.
        """
        if self.n_pairs < 1:
            raise ConfigError(f"{self.name}: n_pairs={self.n_pairs}; wanted a number from 1")
        pairs = list(itertools.permutations(bodies.original.names[-TESTED:], 2))
        drawn = sorted(np.random.default_rng(context.seed).permutation(len(pairs))[: self.n_pairs])
        found = self.evaluate(
            context, self.methods(context, bodies), bodies.original, [pairs[i] for i in drawn], perturbations=changes
        )
        return [{"damage": e.perturbation, "method": e.method, **_summary(e)} for e in found]


@dataclass(frozen=True)
class Figure12(_OnChangedBodies):
    """Clean bodies matched onto noisy ones.

    Parameters
    ----------
    strengths
        Standard deviations of each coordinate of the noise, in mean edge lengths.
    """

    strengths: tuple[float, ...] = (0.0, 0.05, 0.1, 0.2, 0.3, 0.5)

    def run(self, context: Context) -> Findings:
        """Measure and draw; ConfigError if there is no strength or one is negative."""
        if not self.strengths or min(self.strengths) < 0:
            raise ConfigError(f"{self.name}: strengths are numbers from 0, got {list(self.strengths)}")
        bodies = find_bodies(self.source, context)
        noises = {f"{strength:g}": partial(with_noise, strength=float(strength)) for strength in sorted(self.strengths)}
        rows = self.rows(context, bodies, noises)
        note = (
            f"{self.n_pairs} ordered pairs of the last twenty bodies, {self.points} points each, distance "
            f"{self.distance} on the target without noise. Columns: standard deviation of the noise of each "
            "coordinate, in mean edge lengths of the target. ± is the standard error over targets."
        )
        title = f"Matching onto noisy shapes ({bodies.title}), errors in thousandths of the diameter."
        return self.findings(context, title, ("method", *noises), by_method(rows), (note,), _curves(rows))


@dataclass(frozen=True)
class Figure13(_OnChangedBodies):
    """Whole bodies matched onto such with a part cut away, and onto such with one wrong handle.

    Parameters
    ----------
    fractions
        Shares of the area that are cut away, around one of the extremities.
    """

    fractions: tuple[float, ...] = (0.02, 0.05, 0.1, 0.2)

    def run(self, context: Context) -> Findings:
        """Measure and draw; ConfigError if a fraction is not between 0 and 1."""
        if any(not 0 < fraction < 1 for fraction in self.fractions):
            raise ConfigError(f"{self.name}: fractions are between 0 and 1, got {list(self.fractions)}")
        bodies = find_bodies(self.source, context)
        damages: dict[str, Perturbation] = {"none": partial(with_noise, strength=0.0)}
        damages |= {f"{100 * f:g} % cut away": partial(cut_extremity, fraction=float(f)) for f in self.fractions}
        damages["grown together"] = grown_together
        rows = self.rows(context, bodies, damages)
        notes = (
            f"{self.n_pairs} ordered pairs of the last twenty bodies, {self.points} points left on the target each, "
            f"distance {self.distance} on the whole target. What is cut away lies around the vertex that is farthest "
            "from the middle of the body. Grown together: a bridge of six triangles where the surface comes nearest to "
            "itself although the way along it is at least half of sqrt(area). ± is the standard error over targets.",
            *sorted({f"{row['method']}, {row['damage']}: {row['failed']}" for row in rows if "failed" in row}),
        )
        title = f"Matching onto damaged shapes ({bodies.title}), errors in thousandths of the diameter."
        return self.findings(context, title, ("method", *damages), by_method(rows), notes, _dots(rows))


def cut_extremity(mesh: Mesh, fraction: float) -> Damaged:
    """Cut so much of the area away around the vertex that is farthest from the centre of the surface."""
    areas = mesh.face_areas
    middle = areas @ mesh.corners.mean(axis=1) / areas.sum()
    farthest = int(np.linalg.norm(mesh.vertices - middle, axis=1).argmax())
    return without_part(mesh, farthest, fraction)


def by_method(rows: Sequence[Row]) -> list[Row]:
    """Return a line per method with its error by every change, such as "5.2 ± 0.3", and the rows as its `cells`."""
    lines: dict[str, Row] = {}
    for row in rows:
        line = lines.setdefault(row["method"], {"method": row["method"], "cells": []})
        line["cells"].append(row)
        if row["error"] is not None:
            spread = "" if row["standard error"] is None else f" ± {row['standard error']:.1f}"
            line[row["damage"]] = f"{row['error']:.1f}{spread}"
    return list(lines.values())


def _summary(e: Evaluation) -> Row:
    if e.failures:
        why = next(iter(e.failures.values()))
        return {"error": None, "exact %": None, "within 5 % of the diameter, %": None, "failed": why}
    targets = {row.target: [other for other in e.rows if other.target == row.target] for row in e.rows}
    means = [np.average([row.age for row in rows], weights=[row.points for row in rows]) for rows in targets.values()]
    n = len(means)
    return {
        "error": 1000 * e.summary["age"],
        "standard error": 1000 * float(np.std(means, ddof=1) / n**0.5) if n > 1 else None,
        "exact %": 100 * float((e.errors == 0).mean()),
        "within 5 % of the diameter, %": 100 * float((e.errors <= 0.05).mean()),
        "vertices left": float(np.mean([rows[0].left for rows in targets.values()])),
    }


def _curves(rows: Sequence[Row]) -> Figure:
    figure, axes = new_figure(7.6, 4.0)
    for k, line in enumerate(by_method(rows)):
        known = [row for row in line["cells"] if row["error"] is not None]
        strengths, errors = [float(row["damage"]) for row in known], [row["error"] for row in known]
        axes.plot(strengths, errors, marker="o", markersize=4, label=line["method"], **line_style(k))
    axes.set_ylim(bottom=0)
    axes.set_xlabel("noise (mean edge lengths)")
    axes.set_ylabel(MEAN_ERROR)
    figure.legend(loc="outside right center", frameon=False)
    return figure


def _dots(rows: Sequence[Row]) -> Figure:
    errors: dict[str, list[float]] = {}
    for row in rows:  # of every damage all methods, in one order
        errors.setdefault(row["damage"], []).append(float("nan") if row["error"] is None else row["error"])
    return dots_figure([line["method"] for line in by_method(rows)], {MEAN_ERROR: errors})
