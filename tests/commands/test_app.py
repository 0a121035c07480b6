"""How a command ends: its status, what it says, and what it leaves in the current folder."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch

from csm.commands import app
from csm.mesh.io import read_mesh, write_mesh
from csm.mesh.io.extras import read_extras
from csm.mesh.shape import Mesh
from tests.commands.test_pipeline import SMALL
from tests.shapes import blob
from tests.toyset import write_toys

TRAIN = [*SMALL, "data.root=toys", "trainer.max_epochs=12", "test=false", "logger=none"]


def visible(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir() if not path.name.startswith(".")}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["match"], "match needs two meshes: csm match SOURCE TARGET"),
        (["match", "nan.off", "gone.off"], "nan.off"),
        (["describe", "gone.off", "d.npz"], "gone.off: there is no such file"),
        (["check", "gone"], "gone: there is no such file or folder"),
        (["train", "seed=-1"], "seed=-1: wanted a whole number from 0"),
        (["train", "descriptor=adc"], "did you mean"),
        (["train", "matching=[nope]"], "matching='nope'"),
        (["train", "resume=gone.ckpt"], "gone.ckpt: there is no such checkpoint"),
        (["train", "trainer.precision=3"], "precision"),
        (["evaluate", "gone.ckpt"], "gone.ckpt: there is no such checkpoint"),
        (["evaluate", "humans", "data.test=[]"], "data.test=[]: wanted a set to test on at least"),
        (["matrix"], "matrix needs rows"),
        (["trian"], "did you mean train?"),
    ],
)
def test_a_failing_call_is_one_paragraph_with_status_2_and_leaves_nothing(csm, tmp_path, words, said):
    write_mesh(tmp_path / "nan.off", blob(1))
    (tmp_path / "nan.off").write_text((tmp_path / "nan.off").read_text().replace("\n3 ", "\n3 nan ", 1))
    status, _, error = csm(*words)
    assert status == 2
    assert said in error
    assert error.count("csm: ") == 1
    assert "Traceback" not in error
    assert "Error executing job" not in error
    assert visible(tmp_path) == {"nan.off"}


def test_a_defect_keeps_its_traceback_and_has_status_1(csm, tmp_path, monkeypatch):
    def broken(*args, **options):
        raise ZeroDivisionError("a defect")

    monkeypatch.setattr("csm.commands.check.check_files", broken)
    write_mesh(tmp_path / "a.off", blob(1))
    status, _, error = csm("check", "a.off")
    assert status == 1
    assert "Traceback" in error
    assert "please report it" in error


def test_debug_shows_the_traceback_of_what_can_be_mended(csm):
    status, _, error = csm("describe", "gone.off", "d.npz", "debug=true")
    assert status == 2
    assert "Traceback" in error


def test_match_takes_any_names_and_leaves_one_folder(csm, tmp_path):
    names = ["my body (1)=x.off", "it's #2, é.off"]
    for name in names:
        write_mesh(tmp_path / name, blob(2))
    status, out, _ = csm("match", *names, "descriptor=wks", "descriptor.k=30", "out=2024")
    assert status == 0
    assert "trustworthy partner" in out
    assert visible(tmp_path) == {*names, "2024"}
    assert (np.loadtxt(tmp_path / "2024/map.txt") == np.arange(162)).mean() > 0.9
    account = json.loads((tmp_path / "2024/match.json").read_text())
    assert account["source"]["file"] == names[0]
    assert account["notes"] == []
    status, _, _ = csm("match", *names, "descriptor=wks", "descriptor.k=30", "out=2024")
    assert status == 0, "what csm wrote may be written again"
    (tmp_path / "2024/map.txt").write_text("mine")
    status, _, error = csm("match", *names, "descriptor=wks", "descriptor.k=30", "out=2024")
    assert status == 2
    assert "overwrite=true" in error
    assert (tmp_path / "2024/map.txt").read_text() == "mine"


def test_no_command_writes_over_its_input(csm, tmp_path):
    mesh = blob(2)
    np.savez(tmp_path / "a.npz", vertices=mesh.vertices, faces=mesh.faces)
    for name in ("source.ply", "target.ply"):
        write_mesh(tmp_path / name, mesh)
    before = {name: (tmp_path / name).read_bytes() for name in ("a.npz", "source.ply", "target.ply")}
    for words in (
        ["describe", "mesh=a.npz", "out=a.npz"],
        ["describe", "mesh=a.npz", "out=a.npz", "overwrite=true"],
        ["match", "source=source.ply", "target=target.ply", "out=."],
        ["match", "source=source.ply", "target=target.ply", "out=.", "overwrite=true"],
        ["clean", "source.ply", "source.ply", "overwrite=true"],
        ["clean", "source.ply", "target.ply"],
    ):
        assert csm(*words)[0] == 2
    assert {name: (tmp_path / name).read_bytes() for name in before} == before
    assert visible(tmp_path) == set(before)


def test_clean_writes_nothing_where_nothing_is_left(csm, tmp_path):
    (tmp_path / "point.off").write_text("OFF\n3 1 0\n1 1 1\n1 1 1\n1 1 1\n3 0 1 2\n")
    status, _, error = csm("clean", "point.off", "clean.ply")
    assert status == 2
    assert "point.off: its only face vanishes" in error
    assert [path.name for path in tmp_path.glob("clean*")] == []


def test_clean_writes_the_mesh_its_maps_and_an_account(csm, tmp_path):
    loose = blob(2)
    corners = loose.corners.reshape(-1, 3)
    (tmp_path / "soup.obj").write_text(
        "".join(f"v {x!r} {y!r} {z!r}\n" for x, y, z in corners.tolist())
        + "".join(f"f {i + 1} {i + 2} {i + 3}\n" for i in range(0, len(corners), 3))
    )
    status, out, _ = csm("clean", "soup.obj", "clean.ply")
    assert status == 0
    assert "welded" in out
    assert visible(tmp_path) == {
        *("soup.obj", "clean.ply", "clean.old_to_new.txt", "clean.new_to_old.txt", "clean.clean.json")
    }
    there = np.loadtxt(tmp_path / "clean.old_to_new.txt", dtype=int)
    np.testing.assert_array_equal(read_mesh(tmp_path / "clean.ply").vertices[there], corners)
    assert csm("clean", "soup.obj", "clean.ply")[0] == 0


def test_clean_carries_colours_over_and_says_what_it_leaves_out(csm, tmp_path):
    mesh = blob(1)
    colors = np.random.default_rng(0).integers(0, 256, (mesh.n_vertices, 3)).astype(np.uint8)
    lone = Mesh(np.vstack([[[9.0, 9, 9]], mesh.vertices]), mesh.faces + 1)
    write_mesh(tmp_path / "a.ply", lone, np.vstack([[[0, 0, 0]], colors]).astype(np.uint8))
    status, out, _ = csm("clean", "a.ply", "b.ply")
    assert status == 0
    assert "note: a.ply: the colours of its vertices are carried over" in out
    np.testing.assert_array_equal(read_extras(tmp_path / "b.ply").colors, colors)
    assert json.loads((tmp_path / "b.clean.json").read_text())["carried_over"] == ["colours"]
    out = csm("clean", "a.ply", "c.obj")[1]
    assert "is not carried over: colours; c.new_to_old.txt says which vertex each was" in out
    assert json.loads((tmp_path / "c.clean.json").read_text())["not_carried_over"] == ["colours"]


def test_clean_of_what_it_wrote_says_that_nothing_was_to_be_done(csm, tmp_path):
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [-1, 0, 0], [0, -1, 1]])
    write_mesh(tmp_path / "a.off", Mesh(corners, np.array([[0, 1, 2], [0, 2, 3], [0, 1, 4], [0, 5, 6]])))
    assert "changed the mesh" in csm("clean", "a.off", "b.off", "debris=0")[1]
    assert "nothing had to be mended" in csm("clean", "b.off", "c.off", "debris=0")[1]
    assert (tmp_path / "b.off").read_bytes() == (tmp_path / "c.off").read_bytes()


def test_describe_gives_rows_for_the_vertices_of_the_file(csm, tmp_path):
    shutil.copy(Path(__file__).parent.parent / "cases/spot_isolated_vertex.off", tmp_path / "a.off")
    status, out, _ = csm("describe", "a.off", "d.npz", "descriptor=gps", "descriptor.k=20")
    assert status == 0
    assert "1 vertex in no face" in out
    assert str(np.load(tmp_path / "d.npz")["preset"]) == "gps"
    values = np.load(tmp_path / "d.npz")["values"]
    assert np.isnan(values).all(axis=1).sum() == 1
    assert len(values) == 830


def test_two_runs_of_one_second_get_two_folders(tmp_path, monkeypatch):
    monkeypatch.setattr(app.time, "strftime", lambda form: "2026-01-01_00-00-00")
    made = [app.new_folder(tmp_path / "train") for _ in range(3)]
    assert [folder.name.removeprefix("2026-01-01_00-00-00") for folder in made] == ["", "_2", "_3"]
    assert all(folder.is_dir() for folder in made)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "status"),
    [(signal.SIGTERM, 143), pytest.param(signal.SIGINT, 130, marks=pytest.mark.long)],
    ids=["TERM", "INT"],
)
def test_a_stopped_training_says_what_is_kept_and_goes_on_in_its_folder(tmp_path, number, status):
    write_toys(tmp_path / "toys")
    words = [sys.executable, "-m", "csm.commands.train", *TRAIN]
    environment = {**os.environ, "CSM_CACHE": str(tmp_path / "store")}

    def start(folder: str, *more: str) -> subprocess.Popen[str]:
        line = [*words, f"hydra.run.dir={folder}", *more]
        return subprocess.Popen(
            line, cwd=tmp_path, env=environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE
        )

    lines = ["callbacks=default", "~callbacks.errors", "~callbacks.panels"]
    assert start("whole", "callbacks=none").wait() == 0
    run = start("cut", *lines)
    assert run.stdout is not None
    assert any(line.startswith("epoch 3 ") for line in run.stdout), run.communicate()
    run.send_signal(number)
    _, error = run.communicate(timeout=60)
    assert run.returncode == status
    assert "csm: stopped: " in error
    assert "of 12 epochs are done" in error
    assert "Traceback" not in error
    assert start("cut", "callbacks=none").wait() == 0
    whole, cut = (torch.load(tmp_path / f / "model.ckpt", weights_only=True)["state_dict"] for f in ("whole", "cut"))
    assert all(torch.equal(whole[name], cut[name]) for name in whole)


def test_what_a_user_has_in_a_run_folder_stays(csm, tmp_path):
    mine = tmp_path / "mine"
    mine.mkdir()
    (mine / "result.json").write_text("mine")
    status, _, error = csm("train", "experiment=demo", "hydra.run.dir=mine")
    assert status == 2
    assert "mine: this folder holds result.json, which no run of csm train has left there" in error
    assert (mine / "result.json").read_text() == "mine"
    assert [path.name for path in mine.iterdir()] == ["result.json"]


def test_a_refused_run_leaves_what_a_finished_one_says_of_itself(csm, tmp_path):
    write_toys(tmp_path / "toys")
    short = [*TRAIN, "trainer.max_epochs=1", "callbacks=none", "hydra.run.dir=run"]
    assert csm("train", *short)[0] == 0
    said = {p: p.read_bytes() for p in (tmp_path / "run").rglob("*") if p.is_file() and p.suffix in (".json", ".yaml")}
    assert len(said) > 3
    for words in (["train", *short, "seed=-1"], ["train", *short, "model.dropout=0.3"], ["evaluate", *short[-1:]]):
        assert csm(*words)[0] == 2
    assert {path: path.read_bytes() for path in said} == said


def test_jobs_of_a_sweep_do_not_replace_each_others_match(csm, tmp_path):
    write_mesh(tmp_path / "a.off", blob(2))
    words = ["match", "-m", "a.off", "a.off", "descriptor=gps,constant"]
    status, _, error = csm(*words, "out=r", "hydra.sweep.dir=s")
    assert status == 2
    assert "out=r: is the same for all jobs" in error
    assert "out='NAME_${hydra:job.num}'" in error
    assert visible(tmp_path) == {"a.off"}
    assert csm(*words, "out='r_${hydra:job.num}'", "hydra.sweep.dir=t")[0] == 0
    assert {"r_0", "r_1"} <= visible(tmp_path)
    assert len((tmp_path / "t/sweep.csv").read_text().splitlines()) == 3


def test_a_match_that_fails_while_it_writes_leaves_nothing_and_can_be_repeated(csm, tmp_path, monkeypatch):
    write_mesh(tmp_path / "a.off", blob(2))
    words = ["match", "a.off", "a.off", "descriptor=gps", "out=r"]

    def full(*args):
        raise OSError(28, "No space left on device", "r/match.html")

    with monkeypatch.context() as broken:
        broken.setattr("csm.viewer.match_folder.write_html", full)
        status, _, error = csm(*words)
    assert status == 2
    assert "the disk is full" in error
    assert list((tmp_path / "r").iterdir()) == []
    assert csm(*words)[0] == 0
    assert "match.json" in visible(tmp_path / "r")
