from __future__ import annotations

import json
from dataclasses import asdict

from csm.data.store import Store
from csm.studies.contenders import Contender
from csm.studies.steps import Cost, cost_of
from tests.shapes import blob


def test_a_cost_is_measured_in_a_process_of_its_own(tmp_path):
    contender = Contender("x", "csmcnn", "acd_isotropic", {"ks": 16, "channels": [8, 8], "terms": 2}, basis_k=16)
    cost = cost_of(contender, blob(2), Store(tmp_path), threads=1, repeats=3)
    assert len(cost.train) == len(cost.test) == 3
    assert min(*cost.train, *cost.test) > 0
    assert cost.classifier == 257 * 162
    assert cost.seconds == sorted(cost.train)[1]
    assert cost.test_seconds == sorted(cost.test)[1]


def test_a_cost_survives_json():
    cost = Cost(10, 4, (1.0, 2.0), (0.5,), 0.9, None)
    assert Cost.from_plain(json.loads(json.dumps(asdict(cost)))) == cost
