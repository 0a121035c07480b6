"""The scripts of data_prep."""

import runpy
import subprocess
import sys

import pytest

from csm.data.registry import recognise
from tests.conftest import ROOT, data_folder
from tests.data import layouts
from tests.data.real import REAL

SCRIPTS = {
    "faust": "FAUST_6890",
    "faust_remeshed": "FAUST_10000",
    "scape": "SCAPE_5000",
    "tosca": "TOSCA_5k_remeshed",
    "shrec19": "SHREC19_5k_remeshed",
}


@pytest.fixture
def call(monkeypatch):
    """Run a script as the main program, in this process, and return its exit status."""

    def run(script, *arguments):
        path = ROOT / "data_prep" / f"{script}.py"
        monkeypatch.setattr(sys, "argv", [path.name, *map(str, arguments)])
        with pytest.raises(SystemExit) as caught:
            runpy.run_path(str(path), run_name="__main__")
        return caught.value.code

    return run


@pytest.mark.parametrize("script", SCRIPTS)
def test_help_says_where_to_get_the_data(script, call, capsys):
    assert call(script, "--help") == 0
    printed = capsys.readouterr().out
    assert "http" in printed
    assert "--out" in printed


def test_a_script_runs_from_anywhere(tmp_path):
    layouts.sga18(tmp_path / "in")
    command = [sys.executable, ROOT / "data_prep" / "tosca.py", tmp_path / "in", "--out", tmp_path / "out"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, check=False)
    assert done.returncode == 0, done.stderr
    assert "3 shapes" in done.stdout


def test_several_downloads_at_once(tmp_path, call):
    layouts.lps(tmp_path / "a", n=8000)
    layouts.sga18(tmp_path / "b", ("tr_reg_000", "tr_reg_001", "tr_reg_002"))
    assert call("faust_remeshed", tmp_path / "a", tmp_path / "b", "--out", tmp_path / "out") == 0
    assert sorted(p.name for p in (tmp_path / "out").iterdir() if p.is_dir()) == ["FAUST_5k_remeshed", "FAUST_8000"]


@pytest.mark.data
@pytest.mark.parametrize(
    "script", [pytest.param(s, marks=pytest.mark.long) if s in ("tosca", "faust_remeshed") else s for s in SCRIPTS]
)
def test_real_archives_are_laid_out(script, tmp_path, data_set, call):
    name = SCRIPTS[script]
    archive = data_folder() / f"{name}.tar.xz" if data_folder() else None
    source = archive if archive and archive.is_file() else data_set(name)
    assert call(script, source, "--out", tmp_path) == 0
    laid = recognise(tmp_path / name)
    real = REAL[name]
    assert laid.layout is real.layout
    assert (len(laid.names), len(laid.mapped), len(laid.missing)) == (real.shapes, real.mapped, real.missing)
    assert len(laid.mapped_pairs) == real.mapped_pairs
    assert laid.load(laid.mapped[-1]).truth.n_from == real.template
