"""The page of a match shows how far to believe it, and its descriptors if they are given."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from csm.data.store import Store
from csm.matching import Match, match_meshes
from csm.viewer.match_folder import ACCOUNT, FILES, write_match
from tests.shapes import blob
from tests.viewer.test_scene import unpack


@pytest.fixture(scope="module")
def match(tmp_path_factory: pytest.TempPathFactory) -> Match:
    return match_meshes(blob(3, 1), blob(3, 2), "hks", store=Store(tmp_path_factory.mktemp("store")))


def scene_of(page: str) -> dict[str, Any]:
    (scene,) = re.findall(r'<script type="application/json">(.*?)</script>', page)
    found: dict[str, Any] = json.loads(scene)
    return found


def test_the_page_has_the_map_its_confidence_and_its_verdict(match: Match, tmp_path: Path) -> None:
    write_match(match, tmp_path, "HKS", 1.0)
    assert {path.name for path in tmp_path.iterdir()} == {*FILES, ACCOUNT}
    page = (tmp_path / "match.html").read_text(encoding="utf-8")
    source, target = scene_of(page)["panels"]
    np.testing.assert_array_equal(unpack(source["map"], "i4"), match.indices)
    np.testing.assert_allclose(unpack(source["confidence"], "f4"), match.confidence.values, atol=1e-6)
    assert "confidence" not in target
    assert 'data-mode="distance"' not in page
    assert page.index(match.confidence.verdict[:20]) < page.index("<canvas") < page.index("is mapped to the vertex of")


def test_descriptors_that_are_given_can_be_compared_in_the_page(match: Match, tmp_path: Path) -> None:
    features = match.source.vertices, match.target.vertices
    write_match(match, tmp_path, "HKS", 1.0, features=features)
    page = (tmp_path / "match.html").read_text(encoding="utf-8")
    assert 'data-mode="distance"' in page
    scene = scene_of(page)
    here, there = (unpack(p["features"], "i1").reshape(-1, 3) * np.array(scene["steps"]) for p in scene["panels"])
    exact = np.linalg.norm(features[0][5] - features[1], axis=1)
    np.testing.assert_allclose(np.linalg.norm(here[5] - there, axis=1), exact, atol=0.05)
