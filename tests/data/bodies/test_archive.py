from __future__ import annotations

import pickle

import numpy as np
import pytest

from csm.data.additional import additional
from csm.data.bodies import archive
from csm.data.bodies.archive import FORMAT, Bodies, make_bodies
from csm.data.humans import HumansSet, load_humans
from csm.data.packed import pack
from csm.data.store import Store
from csm.errors import ConfigError, DataError


@pytest.fixture
def file(tmp_path):
    """Three built-in humans, written as bodies are."""
    path = tmp_path / "few.npz"
    shapes = np.stack([load_humans()[k].vertices for k in range(3)])
    np.savez(path, **pack(shapes), format=np.array(FORMAT), seed=np.array(0), versions=np.array(["csm"]))
    return path


def test_a_file_is_a_set_over_the_template_of_the_humans(file):
    bodies = Bodies(file)
    assert (bodies.name, bodies.names, repr(bodies)) == (
        "few",
        ("b00000", "b00001", "b00002"),
        f"Bodies('{file}', 3 bodies)",
    )
    shape, human = bodies.load("b00002"), load_humans()[2]
    assert abs(shape.mesh.vertices - human.vertices).max() < 1e-4
    assert (shape.truth.indices == np.arange(human.n_vertices)).all()
    assert pickle.loads(pickle.dumps(bodies)).names == bodies.names
    with pytest.raises(DataError, match=r"b00003.* names run from b00000 to b00002"):
        bodies.load("b00003")


def test_bodies_train_beside_other_shapes_with_their_own_triangles_or_others(file, tmp_path):
    other = additional(f"{file}:remeshed_900", HumansSet(), (), Store(tmp_path / "store"))
    assert (other.template, len(other.names), other.shapes.load("b00001").mesh.n_vertices) == ("", 3, 900)
    beside = additional(str(file), archive.Bodies(file), (), Store(tmp_path / "store"))
    assert (beside.template, beside.n_classes) == ("humans", 6899)


def test_what_is_no_file_of_bodies_is_named(file, tmp_path):
    with pytest.raises(DataError, match=r"no.npz: there is no such file; `csm bodies"):
        Bodies(tmp_path / "no.npz")
    file.write_bytes(file.read_bytes()[:5000])
    with pytest.raises(DataError, match=r"few.npz: wanted a file that `csm bodies` has written"):
        Bodies(file)
    np.savez(file, format=np.array("csm bodies 9"), step=np.zeros(1))
    with pytest.raises(DataError, match=r"its format is csm bodies 9"):
        Bodies(file)


@pytest.mark.parametrize("at", range(400, 60_000, 4001))
def test_a_damaged_file_is_named_wherever_it_is_damaged(file, at):
    content = bytearray(file.read_bytes())
    content[at] ^= 0x40
    file.write_bytes(content)
    with pytest.raises(DataError, match=r"few\.npz: .*make it again|its format is"):
        Bodies(file).load("b00000")


@pytest.mark.parametrize("step", [np.zeros(0), np.array(1.0), np.array([np.nan] * 3), np.ones(4)])
def test_arrays_that_do_not_fit_are_refused(file, step):
    with np.load(file) as archive:
        arrays = dict(archive)
    np.savez(file, **(arrays | {"step": step}))
    with pytest.raises(DataError, match=r"few\.npz: wanted a file that `csm bodies` has written"):
        Bodies(file).load("b00000")


@pytest.mark.parametrize(
    ("name", "count", "seed", "said"),
    [
        ("a.txt", 1, 0, r"a\.txt: wanted the name of a file that ends with \.npz"),
        ("a.npz", 0, 0, "count=0: wanted a whole number from 1"),
        ("a.npz", "3", 0, "count='3'"),
        ("a.npz", 1, -1, "seed=-1"),
        ("a.npz", 1, 1.5, r"seed=1\.5"),
    ],
)
def test_arguments_are_checked_first(tmp_path, name, count, seed, said):
    with pytest.raises(ConfigError, match=said):
        make_bodies(tmp_path / name, count, seed)


def test_a_file_that_came_meanwhile_is_left(tmp_path, monkeypatch):
    def made(seed, number):
        (tmp_path / "a.npz").write_text("mine")
        return load_humans()[number].vertices

    monkeypatch.setattr(archive, "_made", made)
    monkeypatch.setattr("csm.data.bodies.making.require_anny", lambda: None)
    with pytest.raises(ConfigError, match="is there already"):
        make_bodies(tmp_path / "a.npz", 1, progress=False)
    assert (tmp_path / "a.npz").read_text() == "mine"


def test_files_of_one_name_are_told_apart(file, tmp_path):
    other = tmp_path / "other" / "few.npz"
    other.parent.mkdir()
    shapes = np.stack([load_humans()[k].vertices for k in range(3, 6)])
    np.savez(other, **pack(shapes), format=np.array(FORMAT), seed=np.array(1), versions=np.array(["csm"]))
    labels = {additional(str(path), HumansSet(), (), Store(tmp_path / "s")).label for path in (file, other)}
    assert len(labels) == 2
    assert all(label.startswith("few (") for label in labels)
