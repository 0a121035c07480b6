from __future__ import annotations

import pytest

from csm.errors import ConfigError
from csm.experiments.sweep_page import write_sweep_report
from tests.experiments.sweepjobs import write_job, write_sweep


@pytest.fixture
def sweep(tmp_path):
    write_sweep(tmp_path)
    return tmp_path


def test_the_page_names_the_best_and_holds_every_job(sweep):
    best = write_sweep_report(sweep, sweep / "sweep.html")
    assert best.settings["model.ks"] == "128"
    assert best.settings["optimizer.lr"] == "0.003"
    page = (sweep / "sweep.html").read_text()
    assert "csm train experiment=humans +trainer.limit_train_batches=2 model.ks=128 optimizer.lr=0.003" in page
    assert "data.root=meshes/own" in page, "a plain path without the quotes that csm puts around it"
    assert "failed: no memory" in page
    for heading in ("The best", "All jobs, best first", "What each parameter does", "Training losses"):
        assert f"<h2>{heading}</h2>" in page


def test_jobs_are_compared_by_what_is_asked_for(sweep):
    assert write_sweep_report(sweep, sweep / "x.html", "train/loss").name == "11"
    with pytest.raises(ConfigError, match=r"no job has 'age/c'; there are age/a, age/b"):
        write_sweep_report(sweep, sweep / "x.html", "age/c")


def test_the_page_warns_of_choosing_by_test_errors_and_claims_nothing_of_values_tried_once(tmp_path):
    for name, ks, held_out, tested in (("0", 32, 0.2, 0.1), ("1", 64, 0.1, 0.3)):
        write_job(tmp_path, name, [f"model.ks={ks}"], **{"val/age": held_out, "age/a": tested})
    assert write_sweep_report(tmp_path, tmp_path / "a.html").name == "1", "held-out shapes decide, where there are some"
    assert write_sweep_report(tmp_path, tmp_path / "b.html", "age/a").name == "0"
    first, second = ((tmp_path / page).read_text() for page in ("a.html", "b.html"))
    assert "errors of test shapes" in second
    assert "errors of test shapes" not in first
    assert "each value was tried once" in first
    assert "100 %" not in first


def test_a_job_without_a_finite_error_is_not_the_best_and_failures_are_told(tmp_path):
    write_job(tmp_path, "0", ["seed=0"], **{"age/a": float("nan")})
    with pytest.raises(ConfigError, match="no job has"):
        write_sweep_report(tmp_path, tmp_path / "a.html")
    write_job(tmp_path, "1", ["seed=1"], **{"age/a": 0.1})
    assert write_sweep_report(tmp_path, tmp_path / "a.html").name == "1"
    write_job(tmp_path / "failed", "0", ["seed=0"], status="failed", error="no memory")
    with pytest.raises(ConfigError, match="all jobs failed, the first: no memory"):
        write_sweep_report(tmp_path / "failed", tmp_path / "b.html")


def test_jobs_that_ended_well_without_the_number_are_named(tmp_path):
    for name, numbers in (("0", {"val/age": 0.2}), ("1", {"val/age": 0.1}), ("2", {"age/a": 0.1})):
        write_job(tmp_path, name, [f"seed={name}"], **numbers)
    write_job(tmp_path, "3", ["seed=3"], status="failed", error="no memory")
    write_sweep_report(tmp_path, tmp_path / "a.html")
    assert "Not compared, as they have no val/age: 1 job (2)." in (tmp_path / "a.html").read_text()
