"""Figure 2: eigenvalues of the isotropic and the anisotropic Laplacians of one shape at several resolutions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from csm._types import FloatArray
from csm.errors import ConfigError
from csm.mesh.shape import Mesh
from csm.operators.operators import Operators
from csm.studies.bodies import Bodies, Source, find_bodies
from csm.studies.study import Context, Findings
from csm.viewer.figures import save_figure
from csm.viewer.spectra import deviation, resolutions_figure


def run(
    context: Context,
    *,
    source: Source | Bodies = "auto",
    alpha: float = 10.0,
    degrees: Sequence[float] = (0.0, 45.0, 90.0, 135.0),
    k: int = 100,
) -> Findings:
    """Compute the spectra of one body in all its triangulations and draw them.

    Parameters
    ----------
    context
        Where data and artefacts are.
    source
        Of the bodies; see `csm.studies.bodies.find_bodies`.
    alpha
        Strength of the anisotropic Laplacians.
    degrees
        Their angles.
    k
        Number of eigenvalues, from 2.

    Raises
    ------
    ConfigError
        If `k` is below 2.
    """
    if k < 2:
        raise ConfigError(f"figure2: k={k}; wanted at least 2 eigenvalues, the first is zero")
    bodies = find_bodies(source, context)
    meshes = {title: shapes.load(bodies.body).mesh for title, shapes in bodies.resolutions.items()}
    spectra: dict[str, dict[str, FloatArray]] = {}
    for title, mesh in meshes.items():
        for operator, evals in _spectra(mesh, context, alpha, degrees, k).items():
            spectra.setdefault(operator, {})[title] = evals
    finest = max(meshes, key=lambda title: meshes[title].n_vertices)
    rows = [
        _row(operator, title, evals, lines[finest])
        for operator, lines in spectra.items()
        for title, evals in lines.items()
    ]
    path = context.out / "figure2.png"
    save_figure(path, resolutions_figure(spectra, finest))
    return Findings(
        "figure2",
        f"Eigenvalues of one shape at several resolutions ({bodies.title}, {bodies.body}; alpha {alpha:g}).",
        ("operator", "mesh", "mean change %", "largest change %"),
        rows,
        (
            f"Changes are relative to the finest mesh, {finest}, over the {k - 1} eigenvalues above zero; every "
            "mesh is scaled to unit area. Refined meshes keep the original vertices and add others on the surface.",
        ),
        (path,),
    )


def _row(operator: str, title: str, evals: FloatArray, reference: FloatArray) -> dict[str, Any]:
    change = np.abs(deviation(evals, reference))
    return {
        "operator": operator,
        "mesh": title,
        "mean change %": float(change.mean()),
        "largest change %": float(change.max()),
        "eigenvalues": evals.tolist(),
    }


def _spectra(mesh: Mesh, context: Context, alpha: float, degrees: Sequence[float], k: int) -> dict[str, FloatArray]:
    operators = Operators(mesh, memo=context.store)
    found = {"isotropic": operators.lbo(k).evals}
    for angle in degrees:
        found[f"anisotropic, {angle:g}°"] = operators.albo(alpha, float(np.radians(angle)), k).evals
    return found
