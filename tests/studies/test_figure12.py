from __future__ import annotations

import pytest

from csm.errors import ConfigError
from csm.studies.figure12 import run
from tests.studies.toys import toy_bodies, toy_context

SMALL = {"descriptors": ["acd_isotropic"], "n_pairs": 2, "points": 40, "distance": "edge"}


def test_errors_grow_with_the_noise_and_there_is_a_picture(tmp_path):
    found = run(toy_context(tmp_path), source=toy_bodies(), strengths=[1.0, 0.0, 0.2], **SMALL)
    (line,) = found.rows
    assert found.columns == ("method", "0", "0.2", "1")
    assert [row["damage"] for row in line["cells"]] == ["0", "0.2", "1"]
    none, _, most = (row["error"] for row in line["cells"])
    assert line["1"].startswith(f"{most:.1f}")
    assert most > none + 20
    assert found.pictures[0].is_file()


@pytest.mark.parametrize("wrong", [{"strengths": []}, {"strengths": [-1.0]}, {"descriptors": []}, {"n_pairs": 0}])
def test_wrong_options_are_refused(tmp_path, wrong):
    with pytest.raises(ConfigError):
        run(toy_context(tmp_path), source=toy_bodies(), **(SMALL | wrong))
