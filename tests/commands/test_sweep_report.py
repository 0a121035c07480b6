from __future__ import annotations

from tests.experiments.test_sweeps import write_job


def test_a_page_is_written_into_the_folder_and_the_best_job_said(csm, tmp_path):
    write_job(tmp_path / "runs", "0", ["model.ks=32"], **{"age/a": 0.02})
    write_job(tmp_path / "runs", "1", ["model.ks=64"], **{"age/a": 0.01})
    status, out, _ = csm("sweep-report", "runs")
    assert status == 0
    assert "the best is job 1: model.ks=64" in out
    assert (tmp_path / "runs" / "sweep.html").is_file()
    assert csm("sweep-report", "runs")[0] == 0  # its own page is made again
    (tmp_path / "mine.html").write_text("mine")
    status, _, error = csm("sweep-report", "runs", "out=mine.html")
    assert status == 2
    assert "mine.html: is there already" in error
    assert (tmp_path / "mine.html").read_text() == "mine"


def test_what_is_missing_is_said(csm):
    assert "needs the folder of a sweep" in csm("sweep-report")[2]
    assert "gone: there is no such folder" in csm("sweep-report", "gone")[2]


def test_a_page_of_another_is_left(csm, tmp_path):
    write_job(tmp_path / "runs", "0", ["model.ks=32"], **{"age/a": 0.02})
    (tmp_path / "runs" / "sweep.html").write_text("mine")
    status, _, error = csm("sweep-report", "runs")
    assert status == 2
    assert "no page of this command" in error
    assert (tmp_path / "runs" / "sweep.html").read_text() == "mine"
