"""Ways to damage a file: flipped bits, cuts, doubled pieces, exchanged and extreme numbers."""

from __future__ import annotations

import gzip
import io
import random
import re
import zipfile
import zlib
from collections.abc import Callable
from typing import TypeAlias

Way: TypeAlias = Callable[[bytes, random.Random], bytes]


EXTREME = [b"\0", b"\xff", b"\x7f", b"\x80", b"\xff" * 4, b"\0" * 4, b"\xff" * 8, b"\xff\xff\xff\x7f", b"\0\0\0\x80"]
WORDS = [b"-1", b"0", b"1e999", b"nan", b"99999999999999999999", b"4294967295", b"1e6", b"-0", b"3.5", b"x", b"", b"\0"]


def mutated(data: bytes, rng: random.Random) -> bytes:
    """Damage a file in one to five ways; what is compressed inside of it is sometimes damaged before packing."""
    if rng.random() < 0.3:
        data = _inside(data, rng)
    for _ in range(rng.choice([1, 1, 1, 2, 3, 5])):
        if not data:
            break
        data = rng.choice(_WAYS)(data, rng)
    return data


def _place(data: bytes, rng: random.Random) -> int:
    """Choose a byte, more often one of the head."""
    return rng.randrange(min(len(data), rng.choice([64, 300, 1200, len(data)])))


def _flip(data: bytes, rng: random.Random) -> bytes:
    at = _place(data, rng)
    return data[:at] + bytes([data[at] ^ 1 << rng.randrange(8)]) + data[at + 1 :]


def _byte(data: bytes, rng: random.Random) -> bytes:
    at = _place(data, rng)
    return data[:at] + bytes([rng.randrange(256)]) + data[at + 1 :]


def _extreme(data: bytes, rng: random.Random) -> bytes:
    at, new = _place(data, rng), rng.choice(EXTREME)
    at -= at % min(len(new), 4)
    return data[:at] + new + data[at + len(new) :]


def _cut(data: bytes, rng: random.Random) -> bytes:
    return data[: rng.randrange(len(data))]


def _drop(data: bytes, rng: random.Random) -> bytes:
    at = _place(data, rng)
    return data[:at] + data[at + rng.choice([1, 2, 4, 8, 50]) :]


def _double(data: bytes, rng: random.Random) -> bytes:
    at, size = _place(data, rng), rng.choice([1, 4, 8, 40, 300])
    return data[: at + size] + data[at : at + size] * rng.choice([1, 1, 3, 50]) + data[at + size :]


def _exchange(data: bytes, rng: random.Random) -> bytes:
    width = rng.choice([1, 4, 8, 16])
    a, b = (_place(data, rng) // width * width for _ in range(2))
    found = bytearray(data)
    found[a : a + width], found[b : b + width] = data[b : b + width], data[a : a + width]
    return bytes(found)


def _number(data: bytes, rng: random.Random) -> bytes:
    """Put another number in the place of one that is written in digits."""
    numbers = list(re.finditer(rb"-?\d[\d.e+-]*", data[:3000]))
    if not numbers:
        return _byte(data, rng)
    found = rng.choice(numbers[: rng.choice([3, 10, len(numbers)])])
    new = rng.choice([*WORDS, str(rng.randrange(100)).encode(), found[0] + b"0", found[0][:-1]])
    return data[: found.start()] + new + data[found.end() :]


def _word(data: bytes, rng: random.Random) -> bytes:
    """Put another word of the head in the place of one."""
    words = list(re.finditer(rb"[A-Za-z_]{2,}", data[:2000]))
    if not words:
        return _byte(data, rng)
    found, other = rng.choice(words), rng.choice(words)
    return data[: found.start()] + other[0] + data[found.end() :]


def _lines(data: bytes, rng: random.Random) -> bytes:
    lines = data.split(b"\n")
    at = rng.randrange(len(lines))
    way = rng.randrange(4)
    lines[at : at + 1] = [[], [b""], [lines[at]] * rng.choice([2, 500]), [lines[at].replace(b" ", b"\n")]][way]
    return b"\n".join(lines)


def _inside(data: bytes, rng: random.Random) -> bytes:
    """Damage what is inside of a packed file and pack it again, so that the damage arrives at the parser."""
    damage = rng.choice(_WAYS)
    if data.startswith(b"\x1f\x8b"):
        return gzip.compress(damage(gzip.decompress(data), rng))
    if data.startswith(b"PK"):
        return _inside_zip(data, damage, rng)
    for start in (m.start() for m in re.finditer(rb"\x78\x9c", data)):
        stream = zlib.decompressobj()
        try:
            content = stream.decompress(data[start:])
        except zlib.error:
            continue
        packed = zlib.compress(damage(content or b" ", rng))
        size = len(packed).to_bytes(4, "little") if data[:6] == b"MATLAB" else data[start - 4 : start]
        return data[: start - 4] + size + packed + stream.unused_data
    return data


def _inside_zip(data: bytes, damage: Way, rng: random.Random) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as old, zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as new:
        chosen = rng.choice(old.namelist())
        for name in old.namelist():
            content = old.read(name)
            new.writestr(name, damage(content, rng) if name == chosen else content)
    return stream.getvalue()


_WAYS = [_flip, _byte, _extreme, _extreme, _cut, _drop, _double, _exchange, _number, _number, _word, _lines]
