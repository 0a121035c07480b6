"""What can be reached on other triangulations: a perfect map's error there, beside descriptors and networks.

The truth of a pair is a vertex for each point of the template.  Where vertices are other ones, that vertex is near the
point and not on it, on the source and on the target; so even a map that knows for each vertex of the source the exact
place on the target, and takes the vertex nearest to it, often ends at another vertex than the truth.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from csm._types import FloatArray
from csm.data.shapes import ShapeSet
from csm.data.variants import in_form
from csm.errors import ConfigError, DataError
from csm.matching.methods import PrecomputedMethod
from csm.mesh.shape import Mesh
from csm.mesh.surface import Surface
from csm.reproduction.bodies import Bodies, find_bodies
from csm.reproduction.methods_on_bodies import TESTED, OnBodiesWithNetworks, Row
from csm.reproduction.study import MEAN_ERROR, Context, Findings, OnPoints
from csm.viewer.comparisons import dots_figure

PERFECT = "a perfect map"
_STARTS = 4


@dataclass(frozen=True)
class Triangulations(OnPoints, OnBodiesWithNetworks):
    """The last bodies of a set in several triangulations, matched onto each other within each.

    Parameters
    ----------
    forms
        Triangulations besides the original one, as those of ``data.test_forms``.
    n_bodies
        How many bodies; all their ordered pairs are matched.
    """

    descriptors: tuple[str, ...] = ()
    points: int = 100
    forms: tuple[str, ...] = ("slivers_30", "remeshed_5000", "uneven_8000")
    n_bodies: int = TESTED

    def run(self, context: Context) -> Findings:
        """Measure and draw; ConfigError if there are fewer than two bodies, or the bodies have different faces."""
        if self.n_bodies < 2:
            raise ConfigError(f"{self.name}: n_bodies={self.n_bodies}; wanted at least 2")
        bodies = find_bodies(self.source, context)
        names = bodies.original.names[-self.n_bodies :]
        sets: dict[str, ShapeSet] = {"original": bodies.original}
        sets |= {form: in_form(bodies.original, form, context.store, f"{self.name}.forms") for form in self.forms}
        rows = [row for title, shapes in sets.items() for row in self._rows(context, bodies, title, shapes, names)]
        methods = dict.fromkeys(row["method"] for row in rows)
        values = {title: [row["error"] for row in rows if row["triangulation"] == title] for title in sets}
        return self.findings(
            context,
            f"Errors in several triangulations of the same bodies ({bodies.title}), thousandths of the diameter.",
            ("triangulation", "method", "error", "exact %", "95th percentile"),
            rows,
            (
                f"All ordered pairs of the last {len(names)} bodies, {self.points} template points, distance "
                f"{self.distance}, nearest neighbours without refinement.",
                "A perfect map knows for each vertex of the source its exact place on the target, and takes the vertex "
                "that is nearest to that place on the body in its first pose; the truth is known to the nearest "
                "vertex only.",
            ),
            dots_figure(list(methods), {MEAN_ERROR: values}),
        )

    def _rows(
        self, context: Context, bodies: Bodies, title: str, shapes: ShapeSet, names: tuple[str, ...]
    ) -> list[Row]:
        places = {name: on_template(bodies.original, name, shapes.load(name).mesh, names[0]) for name in names}
        perfect = PrecomputedMethod(places, PERFECT)
        methods = [*self.optional_methods(context, bodies), perfect]
        found = self.evaluate(context, methods, shapes, list(itertools.permutations(names, 2)))
        return [
            {
                "triangulation": title,
                "method": e.method,
                "error": 1000 * e.summary["age"],
                "exact %": 100 * e.summary["exact"],
                "95th percentile": 1000 * e.summary["p95"],
            }
            for e in found
        ]


def on_template(original: ShapeSet, name: str, mesh: Mesh, template: str) -> FloatArray:
    """Return where the vertices of a shape in another triangulation lie on another body of the set, (N, 3).

    Parameters
    ----------
    original
        Bodies with the same faces.
    name
        Of the shape in the set.
    mesh
        The same surface in another triangulation, of N vertices.
    template
        Name of the body that places are on.

    Raises
    ------
    DataError
        If the two bodies have different faces.
    """
    body, other = original.load(name).mesh, original.load(template).mesh
    if not np.array_equal(body.faces, other.faces):
        raise DataError(
            f"{original.name}: {name} and {template} have different faces; wanted bodies with the same ones"
        )
    surface = Surface(body)
    corners = surface.at_vertices().faces
    _, starts = cKDTree(body.vertices).query(mesh.vertices, k=_STARTS)
    best, places = np.full(mesh.n_vertices, np.inf), np.empty((mesh.n_vertices, 3))
    for start in np.asarray(starts).T:  # where two sheets touch, the nearest vertex may be on the other one
        found = surface.walk(mesh.vertices, corners[start])
        distance = np.linalg.norm(found.interpolate(body, body.vertices) - mesh.vertices, axis=1)
        nearer = distance < best
        best[nearer], places[nearer] = distance[nearer], found.interpolate(body, other.vertices)[nearer]
    return places
