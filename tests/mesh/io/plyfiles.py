"""PLY files of any kind, written number by number, for the tests of their reader."""

from __future__ import annotations

import numpy as np

from tests.shapes import blob

MESH = blob(1)
_KIND = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"}
_KIND |= {"float": "f4", "double": "f8"}
FORMS = ["ascii", "binary_little_endian", "binary_big_endian"]
XYZ = [(f"double {axis}", MESH.vertices[:, i].tolist()) for i, axis in enumerate("xyz")]
FACES = MESH.faces.tolist()
V = "property float x\nproperty float y\nproperty float z\n"


def made(form: str, elements: dict[str, list[tuple[str, list]]], head: str = "") -> bytes:
    """Write any PLY file: per element (declaration without "property", rows), a list as its values."""
    text = f"ply\nformat {form} 1.0\n{head}"
    for name, columns in elements.items():
        text += f"element {name} {len(columns[0][1])}\n" + "".join(f"property {kind}\n" for kind, _ in columns)
    body = b""
    for columns in elements.values():
        for i in range(len(columns[0][1])):
            words = []
            for kind, rows in columns:
                part = kind.split()
                items = [(part[2], v) for v in rows[i]] if part[0] == "list" else [(part[0], rows[i])]
                words += [(part[1], len(items)), *items] if part[0] == "list" else items
            if form == "ascii":
                body += " ".join(repr(v) for _, v in words).encode() + b"\n"
            else:
                order = "<" if "little" in form else ">"
                body += b"".join(np.array(v, np.dtype(_KIND[k]).newbyteorder(order)).tobytes() for k, v in words)
    return text.encode() + b"end_header\n" + body
