"""What a user holds in hand shows itself in one line that says what it is and how large."""

from __future__ import annotations

import numpy as np
import pytest
import torch

import csm
from csm.evaluation import EvaluationProtocol
from csm.matching import PrecomputedMethod
from csm.matching.network import NetworkMethod
from csm.mesh.correspondence import ground_truth
from csm.mesh.polygons import PolygonMesh
from csm.mesh.textured import Image, Textured
from tests.evaluation.test_results import PAIRS, summary_of
from tests.matching.test_network import module_for
from tests.shapes import blob, plane

MESH = blob(3)


@pytest.fixture(scope="module")
def shown(tmp_path_factory) -> dict[str, object]:
    store = csm.Store(tmp_path_factory.mktemp("store"))
    match = csm.match(MESH, MESH, "gps", store=store)
    texture = Textured(MESH, np.zeros((MESH.n_faces, 3, 2)), (Image(".png", b"a" * 5000),))
    return {
        "Mesh": MESH,
        "PolygonMesh": PolygonMesh.of(MESH),
        "Features": csm.preset("gps")(MESH),
        "Match": match,
        "VertexMap": match.vertex_map,
        "BarycentricMap": match.into_faces,
        "Way": match.there,
        "Operators": csm.Operators(MESH),
        "Spectrum": csm.Operators(MESH).lbo(5),
        "Geodesics": csm.geodesics(MESH),
        "Store": store,
        "Cleaned": csm.clean(MESH),
        "Finding": csm.check(plane())[0],
        "PointMap": csm.PointMap.identity(5000),
        "GroundTruth": ground_truth(csm.PointMap.identity(5000), csm.PointMap.identity(5000)),
        "ACD": csm.ACD(),
        "DescriptorMethod": match.method,
        "PrecomputedMethod": PrecomputedMethod({"blob": torch.zeros(642, 40)}),
        "NetworkMethod": NetworkMethod(module_for()),
        "Described": match.method.describe(MESH, store),
        "EvaluationProtocol": EvaluationProtocol(),
        "Evaluation": summary_of(PAIRS),
        "Textured": texture,
        "Image": texture.images[0],
        "Humans": csm.load_humans(),
    }


def test_objects_show_themselves_in_one_line_with_their_name(shown):
    texts = {name: repr(thing) for name, thing in shown.items()}
    assert {name: text for name, text in texts.items() if "\n" in text or len(text) > 250} == {}
    assert {name: text for name, text in texts.items() if " object at 0x" in text or "array(" in text} == {}
    assert {name: text for name, text in texts.items() if name not in text} == {}
