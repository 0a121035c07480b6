"""What ``csm bench matching`` compares: csm's ways from two meshes to a map, and those of pyFM and of geomfum.

Each way is a function of two surfaces, made in a process of its own by `measure`, which imports no more than that way
needs.  Settings of the others are those of their own documentation: pyFM 1.3.1 by its README and gallery ("Computing a
map without a correspondence"), geomfum 1.0.0 by its demonstration notebook FM-Demo, without its landmarks, as no way
here is told any.  Surfaces come to them centred and of unit area, as pyFM's README loads them.
"""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from typing import Any, TypeAlias

import numpy as np

from csm._parallel import in_fresh_process
from csm._peak import peak_megabytes
from csm._types import Arrays, FloatArray, IntArray

Surface: TypeAlias = tuple[FloatArray, IntArray]
"""Vertices (N, 3) and faces (M, 3)."""
Way: TypeAlias = Callable[[Surface, Surface], IntArray]
"""Takes source and target; returns for each vertex of the source one of the target."""


@dataclass(frozen=True)
class Competitor:
    """A way from two meshes to a map.

    Parameters
    ----------
    title
        What tables call it.
    package
        What it imports: "csm", "pyFM" or "geomfum".
    settings
        What is done, in words.
    load
        Imports what is needed and returns the way.
    """

    title: str
    package: str
    settings: str
    load: Callable[[], Way]

    @property
    def installed(self) -> bool:
        """Whether the package is there."""
        return find_spec(self.package) is not None


def measure(name: str, source: Surface, target: Surface) -> Arrays:
    """Match two surfaces in a fresh process of one thread, and measure it; nothing is kept from before or for later.

    Returns
    -------
    Arrays
        "indices", shape (N_source,), the map; seconds of the clock, "wall", and of the processor, "cpu", from the
        arrays of both meshes to the map, with all eigenproblems but without imports; "peak", the most memory that the
        process had, and "before", what it had with everything imported, in MB.
    """
    return in_fresh_process(measure_here, name, source, target)


def measure_here(name: str, source: Surface, target: Surface) -> Arrays:
    """Do the work of `measure` in this process."""
    os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"))
    from threadpoolctl import threadpool_limits

    way = COMPETITORS[name].load()
    before = peak_megabytes()
    with threadpool_limits(1):
        clock, work = time.perf_counter(), time.process_time()
        indices = way(source, target)
        wall, cpu = time.perf_counter() - clock, time.process_time() - work
    found = {"wall": wall, "cpu": cpu, "before": before, "peak": peak_megabytes()}
    return {"indices": np.asarray(indices), **{key: np.asarray(value) for key, value in found.items()}}


def _csm(refine: str) -> Way:
    import torch

    from csm.data.store import Store
    from csm.matching.methods import as_method
    from csm.matching.nearest import Nearest
    from csm.matching.refinement.registry import refined
    from csm.mesh.shape import Mesh

    torch.set_num_threads(1)
    (matcher,) = refined([Nearest()], [refine])
    method = as_method("acd")

    def way(source: Surface, target: Surface) -> IntArray:
        with tempfile.TemporaryDirectory() as folder:
            here, there = (method.describe(Mesh(*surface), Store(folder)) for surface in (source, target))
            return matcher(here, there).indices

    return way


def _unit(surface: Surface) -> Surface:
    vertices, faces = surface
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    area = float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()) / 2
    return (vertices - vertices.mean(0)) / np.sqrt(area), faces


def _pyfm(fit: Mapping[str, Any], step: int = 1, subsample: int = 1, zoomout: int = 0, icp: int = 0) -> Way:
    """Fit by WKS, then refine in so many rounds; pyFM's map goes from its second mesh to its first."""
    from pyFM.functional import FunctionalMapping
    from pyFM.mesh import TriMesh

    def way(source: Surface, target: Surface) -> IntArray:
        model = FunctionalMapping(*(TriMesh(*_unit(surface)) for surface in (target, source)))
        model.preprocess(descr_type="WKS", subsample_step=subsample)
        model.fit(**fit)
        refined = None
        if zoomout:
            refined = model.zoomout_refine(nit=zoomout, step=step)
        elif icp:
            refined = model.icp_refine(nit=icp)
        return np.asarray(model.get_p2p(refined))

    return way


def _geomfum(zoomout: int = 0, step: int = 5, k: int = 20) -> Way:
    """Fit by HKS and WKS, then refine in so many rounds; geomfum's map goes from shape b, the source here, to a."""
    from geomfum.convert import P2pFromFmConverter
    from geomfum.refine import ZoomOut
    from geomfum.shape import TriangleMesh

    def way(source: Surface, target: Surface) -> IntArray:
        a, b = (TriangleMesh(*_unit(surface)) for surface in (target, source))
        for shape in (a, b):
            shape.laplacian.find_spectrum(spectrum_size=200, set_as_basis=True)
        matrix = _fitted_by_geomfum(a, b, k)
        if zoomout:
            matrix = ZoomOut(nit=zoomout, step=step)(matrix, a.basis, b.basis)
        return np.asarray(P2pFromFmConverter()(matrix, a.basis, b.basis))

    return way


def _fitted_by_geomfum(a: Any, b: Any, k: int) -> FloatArray:
    """Fit as FM-Demo does; its optimiser needs a package that geomfum does not install, so SciPy is called directly."""
    from geomfum.descriptor.pipeline import ArangeSubsampler, DescriptorPipeline, L2InnerNormalizer
    from geomfum.descriptor.spectral import HeatKernelSignature, WaveKernelSignature
    from geomfum.functional_map import (
        FactorSum,
        LBCommutativityEnforcing,
        OperatorCommutativityEnforcing,
        SpectralDescriptorPreservation,
    )
    from scipy.optimize import minimize

    hks, wks = HeatKernelSignature.from_registry(n_domain=100), WaveKernelSignature.from_registry(n_domain=3)
    pipeline = DescriptorPipeline([hks, ArangeSubsampler(subsample_step=2), wks, L2InnerNormalizer()])
    of_a, of_b = pipeline.apply(a), pipeline.apply(b)
    a.basis.use_k = b.basis.use_k = k
    energy = FactorSum(
        [
            SpectralDescriptorPreservation(a.basis.project(of_a), b.basis.project(of_b), weight=1.0),
            LBCommutativityEnforcing.from_bases(a.basis, b.basis, weight=1e-2),
            OperatorCommutativityEnforcing.from_multiplication(a.basis, of_a, b.basis, of_b, weight=1e-1),
            OperatorCommutativityEnforcing.from_orientation(a, of_a, b, of_b, weight=1e-1),
        ]
    )

    def value(x: FloatArray) -> float:
        return float(energy(x.reshape(k, k)))

    def slope(x: FloatArray) -> FloatArray:
        gradient: FloatArray = energy.gradient(x.reshape(k, k)).ravel()
        return gradient

    found = minimize(value, np.zeros(k * k), jac=slope, method="L-BFGS-B")
    matrix: FloatArray = found.x.reshape(k, k)
    return matrix


_README = {"K": 30, "w_descr": 1e0, "w_lap": 1e-1, "w_dcomm": 1e0, "w_orient": 1e0}
_README_WORDS = (
    "50 WKS, 30 functions, weights 1 (descriptors), 0.1 (Laplacian), 1 (descriptor commutativity), 1 (orientation)"
)
_DEMO_WORDS = (
    "50 HKS and 3 WKS of 200 functions, a fit of 20 functions with weights 1 (descriptors), 0.01 (Laplacian), 0.1 "
    "(descriptor commutativity), 0.1 (orientation)"
)

COMPETITORS: Mapping[str, Competitor] = {
    "acd": Competitor("csm: acd, nearest", "csm", "the nearest neighbour of ACD", partial(_csm, "none")),
    "acd_joint": Competitor("csm: acd, joint", "csm", "the same, refined by refine=joint", partial(_csm, "joint")),
    "acd_multistart": Competitor(
        "csm: acd, multistart", "csm", "the same, refined by refine=multistart", partial(_csm, "multistart")
    ),
    "pyfm": Competitor(
        "pyFM, defaults", "pyFM", "FunctionalMapping with all defaults: 100 WKS, 50 functions", partial(_pyfm, {})
    ),
    "pyfm_readme": Competitor(
        "pyFM, README",
        "pyFM",
        f"{_README_WORDS}; ZoomOut from 30 to 110 by 5",
        partial(_pyfm, _README, subsample=2, zoomout=16, step=5),
    ),
    "pyfm_200": Competitor(
        "pyFM, README, to 200",
        "pyFM",
        f"{_README_WORDS}; ZoomOut from 30 to 200 by 5",
        partial(_pyfm, _README, subsample=2, zoomout=34, step=5),
    ),
    "pyfm_icp": Competitor(
        "pyFM, README, ICP", "pyFM", f"{_README_WORDS}; 10 rounds of ICP", partial(_pyfm, _README, subsample=2, icp=10)
    ),
    "geomfum": Competitor("geomfum, FM-Demo, the fit", "geomfum", _DEMO_WORDS, partial(_geomfum)),
    "geomfum_zoomout": Competitor(
        "geomfum, FM-Demo", "geomfum", f"{_DEMO_WORDS}; ZoomOut from 20 to 120 by 5", partial(_geomfum, zoomout=20)
    ),
}
"""The ways by name."""
