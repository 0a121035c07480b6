"""`read_textured` and `write_textured`: meshes with images on them, as .obj with .mtl and images, .glb or .gltf."""

from __future__ import annotations

import os
import re
from pathlib import Path

import numpy as np

from csm.errors import ConfigError, DataError, MeshError
from csm.mesh.io._gltf_texture import format_glb, parse_gltf_texture
from csm.mesh.io._obj_texture import format_mtl, format_obj_texture, of_triangles, parse_mtl, parse_obj_texture
from csm.mesh.io.choice import Choice
from csm.mesh.io.files import atomic_path, read_bytes
from csm.mesh.io.guard import parsing, require_path_and
from csm.mesh.io.meshes import read_polygons
from csm.mesh.polygons import triangulated
from csm.mesh.textured import Image, Textured


def read_textured(path: str | os.PathLike[str], choose: Choice = None) -> Textured:
    """Read a mesh with its texture coordinates and images.

    Vertices are those that `csm.read_mesh` gives; polygons are split into triangles.  Of materials only the images of
    their colours are read (`map_Kd`, `baseColorTexture`).  Files that the mesh names have to lie beside it, or in
    folders beside it; what is not there is left out, and noted.

    Parameters
    ----------
    path
        The .obj, .glb or .gltf file.
    choose
        Which shape of a file that holds several, as of `csm.read_mesh`.

    Raises
    ------
    MeshError
        If the file cannot be read, or is of another format.
    """
    if not isinstance(path, str | os.PathLike):
        raise ConfigError(f"a textured mesh is read from a file given by its path, got a {type(path).__name__}")
    given = os.fspath(path)
    suffix = Path(given).suffix.lower()
    if suffix not in (".obj", ".glb", ".gltf"):
        raise MeshError(f"{given}: textures are read from .obj, .glb and .gltf files")
    polygons = read_polygons(given, choose=choose)
    data = read_bytes(given)
    with parsing(given, suffix):
        if suffix != ".obj":
            folder = Path(given).parent
            uv, images, image_of, notes = parse_gltf_texture(data, choose, lambda name: read_bytes(folder / name))
            return Textured(polygons.triangles(), uv, images, image_of, (*polygons.notes, *notes))
        found, split = parse_obj_texture(data), triangulated(polygons)
        starts, sizes = polygons.starts[split.face_map], polygons.sizes[split.face_map]
        uv = of_triangles(found.places, polygons.corners, starts, sizes, split.mesh.faces)
        images, number_of, notes = _images(given, found.libraries)
        image_of = np.array([number_of.get(found.materials[i], -1) for i in split.face_map], dtype=np.int64)
        return Textured(split.mesh, uv, images, image_of, (*split.mesh.notes, *notes))


def _images(path: str, libraries: list[str]) -> tuple[tuple[Image, ...], dict[str, int], tuple[str, ...]]:
    """Return the images that the materials of an OBJ file name, the image of each material, and notes."""
    notes: list[str] = []
    names: dict[str, str] = {}
    for library in libraries:
        data = _beside(path, library, notes)
        names |= {} if data is None else parse_mtl(data)
    read = {name: _beside(path, name, notes) for name in dict.fromkeys(names.values())}
    there = {name: data for name, data in read.items() if data is not None}
    images = tuple(Image(Path(name).suffix.lower() or ".png", data) for name, data in there.items())
    number_of = {material: list(there).index(name) for material, name in names.items() if name in there}
    return images, number_of, tuple(notes)


def _beside(path: str, name: str, notes: list[str]) -> bytes | None:
    """Return a file that lies beside another one, or None and a note."""
    parts = name.replace("\\", "/").split("/")
    if any(part in ("", "..") or ":" in part for part in parts):
        notes.append(f"it names the file {name[:80]!r}, which is not beside it and was not read")
        return None
    try:
        return read_bytes(Path(path).parent.joinpath(*parts))
    except DataError:
        notes.append(f"it names the file {name[:80]!r}, which cannot be read there; the mesh is without it")
        return None


def write_textured(path: str | os.PathLike[str], texture: Textured) -> tuple[Path, ...]:
    """Write a mesh with its images as .obj, with an .mtl file and the images beside it, or as one .glb.

    An .obj reads back with the same bits.  A .glb has numbers of 32 bits, and vertices on seams are in it several
    times, because there a vertex has one place in the image.

    Parameters
    ----------
    path
        The file; its suffix chooses the format.
    texture
        What to write.

    Returns
    -------
    tuple[Path, ...]
        The files that were written.

    Raises
    ------
    ConfigError
        If it is no path and textured mesh, or the two are exchanged.
    MeshError
        If the suffix is another one.
    DataError
        If a file cannot be written, or a file with other content than ours has the name of the .mtl file or an image.
    """
    require_path_and(path, texture, Textured, "write_textured")
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in (".obj", ".glb"):
        raise MeshError(f"{path}: textured meshes are written as .obj or .glb")
    if suffix == ".glb":
        with atomic_path(path) as temporary:
            temporary.write_bytes(format_glb(texture))
        return (path,)
    stem = re.sub(r"[^\w.-]", "_", path.stem, flags=re.ASCII)
    numbers = [f"_{i}" if len(texture.images) > 1 else "" for i in range(len(texture.images))]
    images = {f"{stem}{i}{image.suffix}": image.data for i, image in zip(numbers, texture.images, strict=True)}
    beside = {**images, f"{stem}.mtl": format_mtl(list(images))} if images else {}
    for name, data in beside.items():
        _require_free(path.with_name(name), data)
    for name, data in beside.items():
        with atomic_path(path.with_name(name)) as temporary:
            temporary.write_bytes(data)
    with atomic_path(path) as temporary:
        temporary.write_bytes(format_obj_texture(texture, f"{stem}.mtl"))
    return (path, *(path.with_name(name) for name in beside))


def _require_free(path: Path, data: bytes) -> None:
    if os.path.lexists(path) and not (path.is_file() and read_bytes(path) == data):
        raise DataError(f"{path}: there is such a file with other content, which is not replaced; choose another name")
