import gzip
import os
import socket
import zlib
from pathlib import Path

import numpy as np
import pytest

from csm.errors import DataError, MeshError
from csm.mesh.io import read_bytes, read_labels, read_mesh, read_names, read_pairs
from csm.mesh.io.files import read_bytes_of_head
from csm.mesh.io.guard import inflate, parsing, refusals, require_regular

READERS = {
    "read_bytes": read_bytes,
    "head": read_bytes_of_head,
    "read_mesh": read_mesh,
    "read_names": read_names,
    "read_pairs": read_pairs,
    "read_labels": lambda p: read_labels(p, direction=None, base=0, n_to=1),
}


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs pipes in the file system")
@pytest.mark.parametrize("read", READERS.values(), ids=READERS.keys())
def test_what_never_ends_is_refused_without_opening_it(tmp_path, monkeypatch, read):
    monkeypatch.chdir(tmp_path)  # the name of a socket may not be long
    os.mkfifo(tmp_path / "pipe.off")
    (tmp_path / "zero.off").symlink_to("/dev/zero")
    with socket.socket(socket.AF_UNIX) as server:
        server.bind("s.off")
        for name, kind in (("pipe.off", "a named pipe"), ("zero.off", "a device"), ("s.off", "a socket")):
            with pytest.raises((DataError, MeshError), match=rf"{name}: this is {kind}, wanted a file"):
                read(tmp_path / name)


@pytest.mark.parametrize("read", READERS.values(), ids=READERS.keys())
def test_names_that_the_system_refuses(tmp_path, read):
    (tmp_path / "loop.off").symlink_to(tmp_path / "loop.off")
    for name, why in (("loop.off", "cannot be read"), ("x" * 300 + ".off", "cannot be read"), ("a\0.off", "cannot be")):
        with pytest.raises((DataError, MeshError), match=why):
            read(tmp_path / name)


def test_a_file_larger_than_the_bound_is_not_opened(tmp_path):
    with (tmp_path / "a.off").open("wb") as file:
        file.truncate(9 << 30)
    with pytest.raises(MeshError, match=r"a\.off: the file has 9216 MiB; csm reads up to 8192 MiB"):
        read_mesh(tmp_path / "a.off")


@pytest.mark.skipif(getattr(os, "geteuid", lambda: 0)() == 0, reason="everything may be read as root")
def test_a_file_that_may_not_be_read(tmp_path):
    (tmp_path / "a.off").write_text("OFF")
    (tmp_path / "a.off").chmod(0)
    with pytest.raises(DataError, match=r"a\.off: cannot be read \(Permission denied\)"):
        read_bytes(tmp_path / "a.off")


def test_require_regular_gives_the_size(tmp_path):
    (tmp_path / "a").write_bytes(b"12345")
    (tmp_path / "b").symlink_to("a")
    assert require_regular(tmp_path / "b") == 5


@pytest.mark.parametrize(
    "error",
    [RecursionError(), zlib.error("x"), OverflowError("x"), NotImplementedError(), RuntimeError("x"), KeyError("x")],
)
def test_whatever_a_parser_raises_becomes_one_sentence_that_names_the_file(error):
    with (
        pytest.raises(MeshError, match=r"^\./a\.off: this is no \.off file, or it is damaged"),
        parsing("./a.off", ".off"),
    ):
        raise error
    with pytest.raises(MeshError, match=r"^\./a\.off: this needs more memory"), parsing("./a.off", ".off"):
        raise MemoryError


def test_a_message_is_one_line_whatever_the_file_has_in_its_names(tmp_path):
    np.savez(tmp_path / "a  b.npz", **{"vertices": np.eye(3), "a\nb\x1b[31m": np.eye(3)})
    with pytest.raises(MeshError) as caught:
        read_mesh(tmp_path / "a  b.npz")
    message = str(caught.value)
    assert message.startswith(f"{tmp_path / 'a  b.npz'}: ")
    assert message.isprintable()
    assert "found vertices, a b [31m" in message


def test_inflating_stops_at_the_limit():
    bomb = gzip.compress(bytes(10**6))
    assert inflate(bomb, limit=10**6) == (bytes(10**6), 0)
    with pytest.raises(MeshError, match="larger than"):
        inflate(bomb, limit=10**6 - 1)
    with pytest.raises(MeshError, match="larger than"):
        inflate(bomb + bomb, limit=10**6 + 1)


def test_inflating_tells_what_is_left_and_what_is_cut():
    whole = zlib.compress(b"abc")
    assert inflate(whole + b"rest", wbits=15) == (b"abc", 4)
    with pytest.raises(MeshError, match="cut short"):
        inflate(whole[:-2], wbits=15)
    with pytest.raises(MeshError, match="damaged"):
        inflate(b"nonsense", wbits=15)


def test_errors_name_the_file_as_given(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("a.off").write_text("x")
    for given in ("./a.off", "a.off", "../" + tmp_path.name + "/a.off"):
        with pytest.raises(MeshError) as caught:
            read_mesh(given)
        assert str(caught.value).startswith(given + ": ")


def test_what_is_not_there_is_told_of_reading_and_of_writing_in_other_words(tmp_path):
    gone = tmp_path / "gone" / "a"
    for doing, said in (("read", "there is no such file"), ("written", r"cannot be written \(No such file")):
        with pytest.raises(DataError, match=f"a: {said}"), refusals(gone, doing):
            gone.mkdir()
