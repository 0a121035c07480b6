from __future__ import annotations

from csm.data.store import Store
from csm.studies.contenders import Contender
from csm.studies.steps import Cost, cost_of, read_cost, write_cost
from tests.shapes import blob


def test_a_cost_is_measured_in_a_process_of_its_own(tmp_path):
    contender = Contender("x", "csmcnn", "acd_isotropic", {"ks": 16, "channels": [8, 8], "terms": 2}, basis_k=16)
    cost = cost_of(contender, blob(2), Store(tmp_path), threads=1, repeats=3)
    assert len(cost.train) == len(cost.test) == 3
    assert min(*cost.train, *cost.test) > 0
    assert cost.classifier == 257 * 162
    assert cost.seconds == sorted(cost.train)[1]
    assert cost.test_seconds == sorted(cost.test)[1]


def test_a_kept_cost_answers_its_question_only(tmp_path):
    path, cost = tmp_path / "costs" / "a.json", Cost(10, 4, (1.0, 2.0), (0.5,), 0.9, 12.0)
    assert read_cost(path, {"a": 1}) is None
    write_cost(path, {"a": 1}, cost)
    assert read_cost(path, {"a": 1}) == cost
    assert read_cost(path, {"a": 2}) is None
