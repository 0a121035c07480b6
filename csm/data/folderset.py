"""A set of shapes in a folder: where meshes and maps are, read one shape at a time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from csm.data.kinds import Kind
from csm.data.shapeset import Shape
from csm.errors import DataError
from csm.mesh.correspondence import Direction, PointMap
from csm.mesh.io import read_labels, read_mesh
from csm.mesh.shape import Mesh


@dataclass(frozen=True)
class FirstVertices:
    """The map is the identity onto the first `n` vertices of every shape."""

    n: int


@dataclass(frozen=True)
class SameFaces:
    """The map is the identity, provided that the shape has the triangles of the first shape of the set."""


Truth = Path | FirstVertices | SameFaces | None
"""How the map of a shape is known: from a 1-based template -> shape file, by a rule, or not at all."""


@dataclass(frozen=True)
class Entry:
    """One shape of a set on disk.

    Parameters
    ----------
    name
        Name of the shape: its file name without suffix.
    mesh
        The mesh file.
    truth, mirror
        How the map from the template, and from the left-right flipped template, is known.
    template
        Which template the maps start from, for sets with several (the classes of TOSCA).
    """

    name: str
    mesh: Path
    truth: Truth = None
    mirror: Path | None = None
    template: str = ""


@dataclass(frozen=True)
class Missing:
    """A file that the published set has and the folder has not, relative to the root, and where to get it."""

    path: str
    origin: str


@dataclass(frozen=True, eq=False)
class FolderSet:
    """A recognised set of shapes; nothing of it is read before it is asked for.

    Parameters
    ----------
    name
        What results call the set: "FAUST_6890", "SCAPE_5000", or the folder's name for a plain folder.
    kind
        The layout that was recognised.
    root
        Folder that all paths lie in.
    entries
        The shapes in natural order of their names.
    pairs
        The pairs of names that the set ships for tests, in its order; empty if it ships none.
    lists
        Lists of names that the set ships, such as "train" and "test".
    missing
        What the published set has and this folder has not.
    extras
        Files with pairs and lists, to be copied along.
    """

    name: str
    kind: Kind
    root: Path
    entries: tuple[Entry, ...]
    pairs: tuple[tuple[str, str], ...] = ()
    lists: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    missing: tuple[Missing, ...] = ()
    extras: tuple[Path, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all shapes, in natural order."""
        return tuple(entry.name for entry in self.entries)

    @property
    def mapped(self) -> tuple[str, ...]:
        """Names of the shapes whose correspondence is known, in natural order."""
        return tuple(entry.name for entry in self.entries if entry.truth is not None)

    @property
    def mapped_pairs(self) -> tuple[tuple[str, str], ...]:
        """Those of `pairs` whose two shapes have maps from one template: the pairs that can be evaluated."""
        known = {entry.name: entry.template for entry in self.entries if entry.truth is not None}
        return tuple((a, b) for a, b in self.pairs if a in known and b in known and known[a] == known[b])

    @property
    def files(self) -> tuple[Path, ...]:
        """All files of the set: meshes, maps, pairs and lists."""
        sources = [path for e in self.entries for path in (e.mesh, e.truth, e.mirror)]
        return (*(path for path in sources if isinstance(path, Path)), *self.extras)

    def entry(self, name: str) -> Entry:
        """Return where a shape is.

        Raises
        ------
        DataError
            If there is no shape of that name.
        """
        try:
            return self._by_name[name]
        except KeyError:
            raise DataError(
                f"{self.root}: there is no shape {name!r} among the {len(self.entries)} of this {self.kind.title} "
                f"folder ({', '.join(self.names[:3])}, ...)"
            ) from None

    def mesh(self, name: str) -> Mesh:
        """Read the mesh of a shape; it need not have a map."""
        return read_mesh(self.entry(name).mesh, name)

    def load(self, name: str) -> Shape:
        """Read a shape with its map, and its mirror map if the set has them.

        Raises
        ------
        DataError
            If there is no such shape, or its correspondence is not known.
        csm.errors.MeshError
            If the mesh file cannot be used.
        """
        return self.with_maps(name, self.mesh(name))

    def with_maps(self, name: str, mesh: Mesh) -> Shape:
        """Join a mesh of this set that is already read with its maps; raises as `load` does."""
        entry = self.entry(name)
        mirror = None if entry.mirror is None else _read_map(entry.mirror, mesh)
        return Shape(mesh, self._truth(entry, mesh), mirror)

    @cached_property
    def _by_name(self) -> dict[str, Entry]:
        return {entry.name: entry for entry in self.entries}

    @cached_property
    def _first(self) -> Mesh:
        return read_mesh(self.entries[0].mesh)

    def _truth(self, entry: Entry, mesh: Mesh) -> PointMap:
        if isinstance(entry.truth, Path):
            return _read_map(entry.truth, mesh)
        if isinstance(entry.truth, FirstVertices):
            return self._identity(entry.truth.n, mesh)
        if isinstance(entry.truth, SameFaces) and _same_connectivity(mesh, self._first):
            return self._identity(mesh.n_vertices, mesh)
        why = "its triangles differ from those of the first shape" if entry.truth else "its map is missing"
        raise DataError(
            f"{entry.mesh}: the correspondence of this shape is not known: {why}; "
            f"wanted a file corres/{entry.name}.vts (line i: the vertex, counted from 1, that is template point i)"
        )

    def _identity(self, n: int, mesh: Mesh) -> PointMap:
        if mesh.n_vertices < n:
            raise DataError(
                f"{self.entry(mesh.name).mesh}: has {mesh.n_vertices} vertices, but in a {self.kind.title} folder the "
                f"first {n} are the template's; is it a remeshed or decimated copy?"
            )
        return PointMap.identity(n, mesh.n_vertices, mesh.name)


def _read_map(path: Path, mesh: Mesh) -> PointMap:
    return read_labels(path, direction=Direction.TEMPLATE_TO_SHAPE, base=1, n_to=mesh.n_vertices)


def _same_connectivity(a: Mesh, b: Mesh) -> bool:
    return a.n_vertices == b.n_vertices and a.faces.shape == b.faces.shape and bool((a.faces == b.faces).all())
