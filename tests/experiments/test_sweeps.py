from __future__ import annotations

import pytest

from csm.errors import DataError
from csm.experiments.sweeps import MEAN_ERROR, importance, read_sweep, varied
from tests.experiments.sweepjobs import write_job, write_sweep


@pytest.fixture
def sweep(tmp_path):
    write_sweep(tmp_path)
    return tmp_path


def test_jobs_are_read_in_order_with_their_losses(sweep):
    jobs = read_sweep(sweep)
    assert [job.name for job in jobs] == [str(k) for k in range(13)]
    assert jobs[0].losses == pytest.approx((5.5, 3.5, 1.5))
    assert jobs[3].value(MEAN_ERROR) == pytest.approx(2 / 32)
    assert (jobs[12].status, jobs[12].value(MEAN_ERROR)) == ("failed", None)
    assert varied(jobs)["model.ks"] == ["32", "64", "128", "256"]
    assert "experiment" not in varied(jobs)


def test_the_variance_belongs_to_the_parameters_that_make_it(sweep):
    shares = importance(read_sweep(sweep)[:12], MEAN_ERROR)
    assert list(shares) == ["model.ks", "optimizer.lr", "seed"]
    assert shares["model.ks"] > 0.95
    assert shares["seed"] == pytest.approx(0, abs=1e-12)
    assert sum(shares.values()) == pytest.approx(1)


def test_what_is_no_sweep_is_named(tmp_path):
    with pytest.raises(DataError, match=r"there are no jobs with result\.json; wanted the folder of a sweep"):
        read_sweep(tmp_path)
    write_job(tmp_path, "0", [])
    for content in ("{", "[]", "{}"):
        (tmp_path / "0" / "result.json").write_text(content)
        with pytest.raises(DataError, match=r"0/result\.json: not a result of a job"):
            read_sweep(tmp_path)
    (tmp_path / "0" / "result.json").rename(tmp_path / "result.json")
    with pytest.raises(DataError, match="this is one training, not a sweep"):
        read_sweep(tmp_path)
