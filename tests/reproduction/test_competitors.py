"""What is compared in a benchmark of matching, on meshes whose map is known."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from csm.reproduction import competitors
from csm.reproduction.competitors import COMPETITORS, Competitor, measure, measure_here
from tests.matching.pairs import relabelled
from tests.shapes import blob

PACKAGES = {"csm", "pyFM", "geomfum"}


@pytest.fixture(scope="module")
def pair():
    mesh = blob(3)
    other, truth = relabelled(mesh)
    return (mesh.vertices, mesh.faces), (other.vertices, other.faces), truth


def test_each_says_what_it_does_and_has_a_title_of_its_own():
    assert {found.package for found in COMPETITORS.values()} == PACKAGES
    assert len({found.title for found in COMPETITORS.values()}) == len(COMPETITORS)
    assert all(found.settings for found in COMPETITORS.values())


def test_a_package_that_is_not_there_is_not_installed():
    assert COMPETITORS["acd"].installed
    assert not Competitor("a", "no_such_package", "b", lambda: None).installed


@pytest.mark.parametrize("name", ["acd", "acd_joint", "acd_multistart"])
def test_csm_maps_the_source_to_the_target_and_its_cost_is_measured(pair, name):
    source, target, truth = pair
    found = measure_here(name, source, target)
    assert (found["indices"] == truth).mean() > 0.99
    assert 0 < found["cpu"] <= 1.2 * found["wall"] + 0.1
    assert found["before"] <= found["peak"] or np.isnan(found["peak"])


@pytest.mark.peers
@pytest.mark.parametrize("name", [name for name, found in COMPETITORS.items() if found.package != "csm"])
def test_the_others_map_the_source_to_the_target(pair, name):
    if not COMPETITORS[name].installed:
        pytest.skip('compares with pyFM and geomfum, which are not installed: pip install "csm-correspondence[peers]"')
    (vertices, faces), target, truth = pair
    found = measure_here(name, (100 * vertices + 3, faces), target)
    off = np.linalg.norm(target[0][found["indices"]] - target[0][truth], axis=1)
    spread = np.linalg.norm(target[0] - target[0].mean(0), axis=1).mean()
    assert off.mean() < 0.1 * spread


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux hands a peak on")
def test_another_process_has_a_peak_of_its_own(pair):
    large = np.ones(2**30, dtype=np.uint8)
    found = measure("acd", *pair[:2])
    assert len(large) == 2**30
    assert 50 < found["before"] < found["peak"] < 1000


def test_to_look_at_the_list_imports_nothing_heavy():
    heavy = "{'torch', 'scipy', 'matplotlib', 'pyFM', 'geomfum'}"
    code = f"import sys, csm.reproduction.competitors; sys.exit(bool({heavy} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_surfaces_come_to_the_others_centred_and_of_unit_area(pair):
    vertices, faces = competitors._unit((100 * pair[0][0] + 7, pair[0][1]))
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    assert np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2 == pytest.approx(1)
    np.testing.assert_allclose(vertices.mean(0), 0, atol=1e-12)
