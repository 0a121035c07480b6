from __future__ import annotations

import json
import os

import numpy as np
import pytest

from csm.commands.outputs import (
    checksum,
    require_file_place,
    require_not_input,
    require_own,
    require_own_archive,
    require_place,
    require_results,
)
from csm.errors import ConfigError, DataError
from csm.mesh.io import file_digest


def test_an_input_is_never_an_output_by_whatever_name(tmp_path):
    mesh, link, hard = tmp_path / "a.ply", tmp_path / "link.ply", tmp_path / "hard.ply"
    mesh.write_text("ply")
    link.symlink_to(mesh)
    hard.hardlink_to(mesh)
    for other in (mesh, link, hard, tmp_path / "x" / ".." / "a.ply"):
        (tmp_path / "x").mkdir(exist_ok=True)
        with pytest.raises(ConfigError, match="would be replaced"):
            require_not_input([other], [mesh])
    require_not_input([tmp_path / "b.ply"], [mesh])


def test_what_csm_wrote_may_be_replaced_and_nothing_else(tmp_path):
    account, path = tmp_path / "match.json", tmp_path / "map.txt"
    require_own([path], account, overwrite=False)
    path.write_text("mine")
    said = r"map\.txt: there is such a file, which was not written by csm.*overwrite=true"
    with pytest.raises(ConfigError, match=said):
        require_own([path], account, overwrite=False)
    require_own([path], account, overwrite=True)
    account.write_text(json.dumps({"files": {"map.txt": file_digest(path)}}))
    require_own([path], account, overwrite=False)
    path.write_text("edited")
    with pytest.raises(ConfigError, match="has been changed since csm wrote it"):
        require_own([path], account, overwrite=False)


@pytest.mark.parametrize("content", ["[]", "{}", "no json", '{"files": 3}'])
def test_a_json_of_somebody_else_is_not_replaced(tmp_path, content):
    (tmp_path / "match.json").write_text(content)
    with pytest.raises(ConfigError, match=r"match\.json"):
        require_own([tmp_path / "map.txt"], tmp_path / "match.json", overwrite=False)


def test_an_archive_is_known_by_its_arrays(tmp_path):
    path = tmp_path / "d.npz"
    arrays = ["values", "checksum"]
    require_own_archive(path, arrays, False)
    np.savez(path, values=np.zeros(2), checksum=np.array(checksum(np.zeros(2))))
    require_own_archive(path, arrays, False)
    np.savez(path, values=np.ones(2), checksum=np.array(checksum(np.zeros(2))))
    with pytest.raises(ConfigError, match="or changed since"):
        require_own_archive(path, arrays, False)
    path.unlink()
    os.mkfifo(path)
    with pytest.raises(ConfigError, match=r"d\.npz"):
        require_own_archive(path, arrays, False)
    with pytest.raises(ConfigError, match=r"d\.npz"):
        require_own([path], tmp_path / "match.json", False)
    path.unlink()
    np.savez(path, vertices=np.zeros(2), faces=np.zeros(2))
    with pytest.raises(ConfigError, match=r"d\.npz"):
        require_own_archive(path, ["values"], False)
    path.write_bytes(b"PK nothing")
    with pytest.raises(ConfigError, match=r"d\.npz"):
        require_own_archive(path, ["values"], False)
    require_own_archive(path, ["values"], True)


def test_places_that_cannot_be_written_are_named_before_the_work(tmp_path):
    file = tmp_path / "file"
    file.touch()
    require_place(tmp_path / "new" / "folder")
    assert not (tmp_path / "new").exists()
    for place, said in (
        (file, "is a file"),
        (file / "below", "a folder|not a dir"),
        (tmp_path / ("x" * 300), "too long"),
    ):
        with pytest.raises(ConfigError, match=f"(?i){said}"):
            require_place(place)
    with pytest.raises(ConfigError, match="this is a folder"):
        require_file_place(tmp_path)
    require_file_place(file)


def test_results_are_added_to_results_only(tmp_path):
    require_results(None)
    require_results(str(tmp_path / "new.json"))
    (tmp_path / "other.json").write_text('{"a": 1}')
    with pytest.raises(DataError, match=r"other\.json"):
        require_results(str(tmp_path / "other.json"))
