from __future__ import annotations

import subprocess
import sys

import pytest

from csm.data.faust import MPI
from csm.data.folder import PLAIN, FolderDataModule
from csm.data.registry import DATA_SETS, data_set, find_set, find_sets, layouts, recognise
from csm.errors import DataError
from csm.mesh.correspondence import ground_truth
from csm.mesh.io import write_mesh
from tests.data import layouts as made
from tests.data.real import REAL
from tests.shapes import sphere


def test_a_data_set_is_known_by_its_name():
    assert data_set("folder").module is FolderDataModule
    assert {name: data_set(name).module.__name__ for name in DATA_SETS} == {
        "humans": "HumansDataModule",
        "faust": "FaustDataModule",
        "scape": "ScapeDataModule",
        "tosca": "ToscaDataModule",
        "shrec19": "Shrec19DataModule",
        "folder": "FolderDataModule",
    }
    with pytest.raises(DataError, match="no data set 'fuast'; there are humans, faust, scape"):
        data_set("fuast")


def test_layouts_have_different_keys_and_origins_and_plain_folders_come_last():
    known = layouts()
    assert len({layout.key for layout in known}) == len({layout.origin for layout in known}) == len(known) == 8
    assert (known[0], known[-1]) == (MPI, PLAIN)


def test_folders_without_meshes_say_where_they_are(tmp_path):
    made.sga18(tmp_path / "FAUST_5k")
    made.shrec19(tmp_path / "shrec")
    with pytest.raises(DataError, match=r"did you mean .*FAUST_5k, .*shrec"):
        recognise(tmp_path)
    (tmp_path / "empty").mkdir()
    with pytest.raises(DataError, match="no meshes that csm can read; wanted one of: MPI-FAUST"):
        recognise(tmp_path / "empty")
    write_mesh(tmp_path / "mine" / "below" / "a.off", sphere(1))
    with pytest.raises(DataError, match=r"no meshes that csm can read; there are some in .*below; wanted"):
        recognise(tmp_path / "mine")
    with pytest.raises(DataError, match="nowhere: there is no such folder"):
        recognise(tmp_path / "nowhere")


def test_sets_are_found_below_a_download(tmp_path):
    made.acd(tmp_path / "repository-main" / "CSMCNN" / "datasets" / "SCAPE")
    made.sga18(tmp_path / "repository-main" / "Dataset" / "TOSCA")
    assert sorted(s.layout.key for s in find_sets(tmp_path)) == ["acd_scape", "sga18_tosca"]


def test_a_set_is_found_by_its_name_first_name_first(tmp_path):
    made.sga18(tmp_path / "a")
    made.shrec19(tmp_path / "b")
    assert find_set(tmp_path, "SHREC19_5k_remeshed", "TOSCA_5k_remeshed").root == tmp_path / "b"
    assert find_set(tmp_path, "FAUST_6890", "TOSCA_5k_remeshed").root == tmp_path / "a"
    found = find_set(tmp_path / "b", "SHREC19_5k_remeshed")
    assert found.names == ("1", "2", "10")
    assert repr(found) == f"FolderSet('SHREC19_5k_remeshed', 3 shapes, {str(tmp_path / 'b')!r})"
    with pytest.raises(DataError, match="wanted SCAPE_5000, but there are SHREC19_5k_remeshed, TOSCA_5k_remeshed"):
        find_set(tmp_path, "SCAPE_5000")
    with pytest.raises(DataError, match="wanted SCAPE_5000, but no published set was recognised there"):
        find_set(tmp_path / "nowhere", "SCAPE_5000")
    (tmp_path / "others" / "my_scans").mkdir(parents=True)
    with pytest.raises(DataError, match="no published set was recognised in its folders my_scans; set"):
        find_set(tmp_path / "others", "SCAPE_5000")


def test_the_default_folder_is_csm_data_or_data(tmp_path, monkeypatch):
    made.shrec19(tmp_path / "elsewhere" / "s")
    made.sga18(tmp_path / "data" / "t")
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("CSM_DATA", raising=False)
    assert find_set(None, "TOSCA_5k_remeshed").root.name == "t"
    monkeypatch.setenv("CSM_DATA", str(tmp_path / "elsewhere"))
    assert find_set(None, "SHREC19_5k_remeshed").root.name == "s"


def test_the_data_sets_need_no_learning_library():
    code = (
        "import sys, csm.data.humans, csm.data.registry as r; [r.data_set(name) for name in r.DATA_SETS]; "
        "print(sorted({'torch', 'lightning', 'hydra'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.stdout.strip(), done.returncode) == ("[]", 0), done.stderr


@pytest.mark.data
@pytest.mark.parametrize("name", REAL)
def test_real_sets(data_set, name):
    real, shapes = REAL[name], recognise(data_set(name))
    assert (shapes.layout, shapes.name) == (real.layout, name)
    counts = (len(shapes.names), len(shapes.mapped), len(shapes.pairs), len(shapes.mapped_pairs), len(shapes.missing))
    assert counts == (real.shapes, real.mapped, real.pairs, real.mapped_pairs, real.missing)
    first, last = shapes.load(shapes.mapped[0]), shapes.load(shapes.mapped[-1])
    assert first.truth.n_from == real.template
    if shapes.entry(first.name).template == shapes.entry(last.name).template:
        assert len(ground_truth(first.truth, last.truth)) == real.template
    assert (first.mirror is not None) == real.layout.key.startswith("sga18")
