"""Fixtures of the tests of matching."""

from __future__ import annotations

import numpy as np
import pytest

from csm._types import IntArray
from csm.data.humans import humans_set
from csm.data.shapes import Shape
from csm.data.store import Store
from csm.operators import Spectrum
from tests.matching.pairs import spectrum_of


@pytest.fixture(scope="session")
def store(tmp_path_factory: pytest.TempPathFactory) -> Store:
    """A store of its own, so that nothing in the user's is used or changed."""
    return Store(tmp_path_factory.mktemp("store"))


@pytest.fixture(scope="session")
def small_human(store: Store) -> Shape:
    """A built-in human in a triangulation of 700 vertices, with the flip of both sides."""
    return humans_set("remeshed_700", str(store.root)).load("s00_p00")


@pytest.fixture(scope="session")
def small_humans(store: Store, small_human: Shape) -> list[Shape]:
    """The same person in two poses."""
    return [small_human, humans_set("remeshed_700", str(store.root)).load("s00_p03")]


@pytest.fixture(scope="session")
def small_spectra(small_humans: list[Shape]) -> tuple[Spectrum, Spectrum, IntArray]:
    """The first 60 eigenpairs of both, and the map from the first to the second."""
    source, target = small_humans
    near = np.zeros(source.mesh.n_vertices, dtype=np.int64)
    near[source.truth.indices] = target.truth.indices
    return spectrum_of(source.mesh, 60), spectrum_of(target.mesh, 60), near
