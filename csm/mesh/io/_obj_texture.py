"""Texture coordinates and materials of Wavefront OBJ files, and of the .mtl files beside them."""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np

from csm._types import FloatArray, IntArray
from csm.errors import MeshError
from csm.mesh.io.raw import decode, is_number
from csm.mesh.textured import Textured

_OPTIONS = {"-blendu": 1, "-blendv": 1, "-cc": 1, "-clamp": 1, "-texres": 1, "-imfchan": 1, "-boost": 1, "-bm": 1}
_OPTIONS |= {"-mm": 2, "-type": 1, "-o": 3, "-s": 3, "-t": 3}  # how many words follow at most


class ObjTexture(NamedTuple):
    """What an OBJ file says of textures.

    `places`, shape (sum of corners, 2), are the coordinates of each corner of each face, NaN for none; `materials` has
    the material of each face, "" for none; `libraries` are the names of the .mtl files.
    """

    places: FloatArray
    materials: list[str]
    libraries: list[str]


def parse_obj_texture(data: bytes) -> ObjTexture:
    """Read the `vt`, `f`, `usemtl` and `mtllib` lines of an OBJ file that `parse_obj` has read.

    Raises
    ------
    MeshError
        If a corner refers to texture coordinates that do not exist, or these are no numbers.
    """
    rows: list[list[str]] = []
    corners: list[int] = []
    materials: list[str] = []
    libraries: list[str] = []
    material = ""
    for line in re.sub(r"\\(\r\n|\n|\r)", " ", decode(data)).splitlines():
        words = line.partition("#")[0].split()
        if not words:
            continue
        if words[0] == "vt":
            rows.append([*words[1:3], "0"][:2])
        elif words[0] == "f":
            corners += [_place(word, len(rows), len(materials)) for word in words[1:]]
            materials.append(material)
        elif words[0] == "usemtl":
            material = " ".join(words[1:])
        elif words[0] == "mtllib":
            libraries.append(line.split(None, 1)[1].strip())
    places = np.vstack([_numbers(rows), [[np.nan, np.nan]]])
    numbers = np.array(corners, dtype=np.int64)
    if numbers.max(initial=-1) >= len(rows):
        raise MeshError(f"a face refers to texture coordinates {numbers.max() + 1}, but there are {len(rows)}")
    return ObjTexture(places[numbers], materials, libraries)


def _numbers(rows: list[list[str]]) -> FloatArray:
    wrong = next((i for i, row in enumerate(rows) if len(row) < 2 or not all(map(is_number, row))), None)
    if wrong is not None:
        raise MeshError(f"texture coordinates {wrong} are {' '.join(rows[wrong])[:80]!r}, wanted two numbers")
    return np.array(rows, dtype=np.float64).reshape(len(rows), 2)


def _place(word: str, n_so_far: int, face: int) -> int:
    """Return the number of the texture coordinates of a corner "v/vt/vn", -1 for none."""
    middle = word.split("/")[1:2]
    if not middle or not middle[0]:
        return -1
    try:
        number = int(middle[0])
    except ValueError:
        number = 0
    if number == 0 or number < -n_so_far:
        raise MeshError(f"face {face} has a corner {word[:40]!r}, whose texture coordinates do not exist")
    return number - 1 if number > 0 else n_so_far + number


def parse_mtl(data: bytes) -> dict[str, str]:
    """Return for each material of an .mtl file the name of the file with its colours (`map_Kd`), if it has one."""
    found: dict[str, str] = {}
    material = ""
    for line in decode(data).splitlines():
        words = line.partition("#")[0].split()
        if words[:1] == ["newmtl"]:
            material = " ".join(words[1:])
        elif [word.lower() for word in words[:1]] == ["map_kd"]:
            found[material] = " ".join(_without_options(words[1:]))
    return found


def _without_options(words: list[str]) -> list[str]:
    while words and words[0].lower() in _OPTIONS:
        at = 1
        numeric = words[0].lower() in ("-o", "-s", "-t")
        while at <= _OPTIONS[words[0].lower()] and (at == 1 or not numeric or re.fullmatch(r"[-+.\deE]+", words[at])):
            at += 1
        words = words[at:]
    return words


def format_obj_texture(texture: Textured, library: str) -> bytes:
    """Write a textured mesh; coordinates are written so that they read back exactly."""
    mesh, numbers = texture.mesh, texture.image_numbers
    has = np.isfinite(texture.uv[:, 0, 0])
    places, which = np.unique(texture.uv[has].reshape(-1, 2), axis=0, return_inverse=True)
    place_of = np.zeros((mesh.n_faces, 3), dtype=np.int64)
    place_of[has] = which.reshape(-1, 3) + 1
    lines = [f"# {mesh.n_vertices} vertices, {mesh.n_faces} faces", *([f"mtllib {library}"] if texture.images else [])]
    lines += ["v " + " ".join(map(repr, row)) for row in mesh.vertices.tolist()]
    lines += ["vt " + " ".join(map(repr, row)) for row in places.tolist()]
    before: int | None = None
    for face, place, image in zip((mesh.faces + 1).tolist(), place_of.tolist(), numbers.tolist(), strict=True):
        if texture.images and image != before:
            lines.append(f"usemtl {material_name(image)}")
        before = image
        lines.append("f " + " ".join(f"{v}/{t}" if t else str(v) for v, t in zip(face, place, strict=True)))
    return ("\n".join(lines) + "\n").encode("ascii")


def material_name(image: int) -> str:
    """Return what the material of an image is called; -1 is that of faces without one."""
    return "plain" if image < 0 else f"image_{image}"


def format_mtl(names: list[str]) -> bytes:
    """Write a material for each image, given by the names of their files, and one for faces without."""
    lines = []
    for i in range(-1, len(names)):
        lines += [f"newmtl {material_name(i)}", "Kd 1 1 1", *([f"map_Kd {names[i]}"] if i >= 0 else []), ""]
    return "\n".join(lines).encode("ascii")


def of_triangles(
    places: FloatArray, polygons: IntArray, starts: IntArray, sizes: IntArray, faces: IntArray
) -> FloatArray:
    """Return the coordinates of triangles, shape (M, 3, 2), into which polygons were split.

    Parameters
    ----------
    places
        Shape (sum of corners, 2): of the corners of all polygons.
    polygons
        Shape (sum of corners,): the vertices of these.
    starts, sizes
        Shape (M,) each: where the polygon of each triangle begins in them, and how many corners it has.
    faces
        Shape (M, 3): the triangles.
    """
    found = np.zeros(faces.shape, dtype=np.int64)
    for step in range(int(sizes.max(initial=0)) - 1, -1, -1):  # of a vertex that is there twice the first is taken
        at = starts + np.minimum(step, sizes - 1)
        here = polygons[at][:, None] == faces
        found[here] = np.broadcast_to(at[:, None], faces.shape)[here]
    return places[found]
