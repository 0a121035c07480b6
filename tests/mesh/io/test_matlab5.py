import io
import struct
import zlib

import numpy as np
import pytest
import scipy.io
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from csm.errors import MeshError
from csm.mesh.io.matlab5 import is_level_4, is_level_5, read_level_4, read_level_5

KINDS = ["i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "f4", "f8", "c16"]
OPTIONS = [{}, {"do_compression": True}, {"oned_as": "column"}, {"long_field_names": True}]


def saved(variables: dict, **options) -> bytes:
    stream = io.BytesIO()
    scipy.io.savemat(stream, variables, **options)
    return stream.getvalue()


def same(mine, theirs) -> None:
    """Compare a value with what scipy reads without any simplification."""
    if isinstance(theirs, np.ndarray) and theirs.dtype.names:
        flat = theirs.ravel(order="F")
        rows = [mine] if theirs.size == 1 else mine
        assert len(rows) == theirs.size
        for row, record in zip(rows, flat, strict=True):
            assert list(row) == list(theirs.dtype.names)
            for key in row:
                same(row[key], record[key])
    elif isinstance(theirs, np.ndarray) and theirs.dtype.kind == "O":
        for one, other in zip(mine, theirs.ravel(order="F"), strict=True):
            same(one, other)
    elif theirs.dtype.kind == "U":
        assert mine is None
    else:
        assert mine.shape == theirs.shape
        np.testing.assert_array_equal(mine, theirs)


def check(variables: dict, **options) -> None:
    data = saved(variables, **options)
    mine = read_level_4(data) if options.get("format") == "4" else read_level_5(data)
    theirs = {k: v for k, v in scipy.io.loadmat(io.BytesIO(data)).items() if not k.startswith("__")}
    assert list(mine) == list(theirs)
    for key in mine:
        same(mine[key], theirs[key])


@settings(deadline=None, max_examples=100)
@given(st.data())
def test_arrays_of_every_kind_and_shape_are_read_as_scipy_wrote_them(data):
    kind = data.draw(st.sampled_from(KINDS))
    array = data.draw(arrays(kind, array_shapes(min_dims=1, max_dims=4, min_side=0, max_side=5)))
    check({"a": array, "b": array[:1]}, **data.draw(st.sampled_from(OPTIONS)))


@pytest.mark.parametrize("options", OPTIONS)
def test_structs_cells_and_text_nest(options):
    cell = np.empty((2, 2), dtype=object)
    cell[:] = [[np.eye(3), {"TRIV": np.ones((4, 3), np.int32)}], ["text", np.zeros((0, 0))]]
    records = np.zeros((3,), dtype=[("x", object), ("y", object)])
    for i in range(3):
        records[i] = (np.arange(i + 1.0), {"deep": {"deeper": [[i]]}})
    check(
        {
            "S": {"surface": {"X": np.arange(5.0), "name": "a", "ok": True}},
            "cell": cell,
            "records": records,
            "word": "hello",
            "many": np.array(["a", "bc"]),
            "scalar": 3,
            "logical": np.array([True, False]),
        },
        **options,
    )


@pytest.mark.parametrize("kind", ["f8", "f4", "i4", "i2", "u2", "u1", "c16"])
def test_level_4_files(kind):
    variables = {"VERT": np.arange(12).reshape(4, 3).astype(kind), "n": np.array([[7.0]]), "t": "text"}
    data = saved(variables, format="4")
    assert is_level_4(data)
    assert not is_level_5(data)
    check(variables, format="4")


def big_endian() -> bytes:
    def element(kind: int, content: bytes) -> bytes:
        return struct.pack(">II", kind, len(content)) + content + bytes(-len(content) % 8)

    parts = element(6, struct.pack(">II", 6, 0)) + element(5, struct.pack(">ii", 1, 2))
    parts += struct.pack(">HH4s", 1, 1, b"a") + element(9, struct.pack(">dd", 1.5, -2))
    return b"MATLAB 5.0".ljust(124) + b"\x01\x00MI" + element(14, parts)


def test_files_of_the_other_byte_order():
    np.testing.assert_array_equal(read_level_5(big_endian())["a"], [[1.5, -2]])
    np.testing.assert_array_equal(scipy.io.loadmat(io.BytesIO(big_endian()))["a"], [[1.5, -2]])


PLAIN = saved({"S": {"VERT": np.arange(12.0).reshape(4, 3)}, "c": np.array([1, "x"], dtype=object)})
PACKED = saved({"S": {"VERT": np.arange(12.0).reshape(4, 3)}}, do_compression=True)


@pytest.mark.parametrize("data", [PLAIN, PACKED], ids=["plain", "packed"])
def test_a_cut_at_any_byte_is_an_error_or_leaves_whole_variables(data):
    whole = read_level_5(data)
    for end in range(128, len(data)):
        try:
            found = read_level_5(data[:end])
        except MeshError:
            continue
        assert set(found) <= set(whole)
        assert "c" not in found or end >= len(data) - 8


@settings(deadline=None, max_examples=300)
@given(st.integers(128, len(PLAIN) - 1), st.integers(0, 2**32 - 1))
def test_any_altered_word_is_an_error_or_is_read_within_the_bytes_that_are_there(at, word):
    data = bytearray(PLAIN)
    data[at // 4 * 4 : at // 4 * 4 + 4] = struct.pack("<I", word)
    try:
        found = read_level_5(bytes(data))
    except MeshError:
        return
    assert sum(a.nbytes for a in found.values() if isinstance(a, np.ndarray)) <= len(data)


def test_structs_nested_without_end_are_refused():
    flags = struct.pack("<IIII", 6, 8, 1, 0) + struct.pack("<IIii", 5, 8, 1, 1) + struct.pack("<II", 1, 0)
    inner = b""
    for _ in range(3000):
        inner = struct.pack("<II", 14, len(flags + inner)) + flags + inner
    data = b"MATLAB 5.0".ljust(124) + b"\x00\x01IM" + inner
    with pytest.raises(MeshError, match="nested more than 50"):
        read_level_5(data)


def test_a_cell_of_very_many_values_is_refused():
    content = struct.pack("<IIII", 6, 8, 1, 0) + struct.pack("<IIii", 5, 8, 1000, 300) + struct.pack("<II", 1, 0)
    content += struct.pack("<II", 14, 0) * 300_000
    packed = zlib.compress(struct.pack("<II", 14, len(content)) + content)
    data = b"MATLAB 5.0".ljust(124) + b"\x00\x01IM" + struct.pack("<II", 15, len(packed)) + packed
    with pytest.raises(MeshError, match="more than 250000 elements"):
        read_level_5(data)
    with pytest.raises(MeshError, match=r"more than .* elements|announces 300000 values"):
        read_level_5(data[:128] + struct.pack("<II", 14, 400) + content[:400])
