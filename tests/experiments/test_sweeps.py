from __future__ import annotations

import json
from itertools import product
from pathlib import Path

import pytest
from torch.utils.tensorboard import SummaryWriter

from csm.errors import ConfigError, DataError
from csm.experiments.sweeps import MEAN_ERROR, importance, read_sweep, varied, write_sweep_report


def write_job(folder: Path, name: str, overrides: list[str], **numbers: object) -> Path:
    place = folder / name
    place.mkdir(parents=True)
    record = {"status": "ok", "seconds": 3.0, "overrides": overrides, **numbers}
    (place / "result.json").write_text(json.dumps(record))
    return place


@pytest.fixture
def sweep(tmp_path):
    """Twelve jobs whose error is that of ks, plus a little of the rate; the seed does nothing."""
    for k, (ks, rate, seed) in enumerate(product((32, 64, 128), ("0.001", "0.003"), (0, 1))):
        error = 1 / ks + (0.001 if rate == "0.001" else 0.0)
        overrides = [
            "experiment=humans",
            "+trainer.limit_train_batches=2",
            f"model.ks={ks}",
            f"optimizer.lr={rate}",
            f"seed={seed}",
            "data.root='meshes/own'",
        ]
        place = write_job(tmp_path, str(k), overrides, **{"age/a": error, "age/b": 3 * error, "train/loss": 9.0 - k})
        with SummaryWriter(place / "tensorboard") as log:
            for step in range(6):
                log.add_scalar("epoch", step // 2, step)
                log.add_scalar("train/loss", 6.0 - step - 0.1 * k, step)
    write_job(tmp_path, "12", ["experiment=humans", "model.ks=256"], status="failed", error="no memory")
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
