from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from csm.commands.outputs import (
    checksum,
    require_file_place,
    require_own_archive,
    require_own_places,
    require_place,
    require_results,
)
from csm.errors import ConfigError, DataError


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


@pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="there is no such file system")
@pytest.mark.parametrize("place", ["/proc/csm", "/proc/csm/below"])
def test_a_file_system_that_takes_no_files_is_named(place):
    said = rf"^out={place}: (nothing can be written into the folder /proc \(.+\)|the folder /proc may not be written)"
    with pytest.raises(ConfigError, match=f"{said}; choose another place$"):
        require_place(Path(place))
    with pytest.raises(ConfigError, match=r"choose another place$"):
        require_file_place(Path(place) / "a.ply")


def test_trying_a_place_leaves_nothing(tmp_path):
    require_place(tmp_path)
    require_place(tmp_path / "new")
    assert list(tmp_path.iterdir()) == []


def test_results_are_added_to_results_only(tmp_path):
    require_results(None)
    require_results(str(tmp_path / "new.json"))
    (tmp_path / "other.json").write_text('{"a": 1}')
    with pytest.raises(DataError, match=r"other\.json"):
        require_results(str(tmp_path / "other.json"))


@pytest.mark.parametrize(
    ("command", "overrides", "shared"),
    [
        ("match", ["-m", "source='a.off'", "target='b.off'", "out='r'", "refine=none,joint"], "out=r: is the same"),
        ("match", ["-m", "source='a.off'", "target='b.off'", "refine=none,joint"], "out: is the same for all jobs"),
        ("match", ["-m", "folder='in'", "out=null", "refine=none,joint"], "out: is the same for all jobs"),
        ("match", ["-m", "source='a.off','c.off'", "target='b.off'", "out='r'"], "out=r: is the same"),
        ("describe", ["--multirun", "mesh='a.off','b.off'", "out='d.npz'"], "out=d.npz: is the same"),
        ("match", ["-m", "source='a.off','c.off'", "target='b.off'"], None),
        ("match", ["-m", "source='a.off'", "target='b.off'", "out='r'"], None),
        ("match", ["source='a.off'", "target='b.off'", "out='r'"], None),
        ("match", ["-m", "source='a.off'", "out='r_${hydra:job.num}'", "refine=none,joint"], None),
        ("clean", ["-m", "in='a.off'", "out='b.off','c.off'", "weld=true,false"], None),
        ("describe", ["-m", "mesh='a.off'", "descriptor=hks,gps", "++out='d_${hydra:job.num}'"], None),
        ("match", ["-m", "++source='a.off','c.off'", "target='b.off'"], None),
        ("train", ["-m", "seed=0,1"], None),
        ("match", ["-m", "out='r'", "refine=[none"], None),
    ],
)
def test_a_place_that_all_jobs_of_a_sweep_share_is_named_before_the_first(command, overrides, shared):
    if shared is None:
        require_own_places(command, overrides)
        return
    with pytest.raises(ConfigError, match=rf"^{shared}.*NAME_\$\{{hydra:job\.num\}}"):
        require_own_places(command, overrides)
