"""Sets of shapes in folders: the layouts in which they are published, and reading them one shape at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path

from csm._counts import counted
from csm.data._connectivity import same_connectivity, shared_mesh
from csm.data.shapes import Shape
from csm.errors import DataError
from csm.mesh.correspondence import Direction, PointMap
from csm.mesh.io import list_files, read_labels, read_mesh, read_pairs
from csm.mesh.shape import Mesh

PAIRS = "test_pairs.txt"
"""File that lists the pairs of a set that are to be matched."""


@dataclass(frozen=True)
class Layout:
    """A layout in which a data set is published.

    Parameters
    ----------
    key
        Short name for options and tests.
    title
        What people call it.
    origin
        Where it comes from and on what terms; csm never downloads it.
    find
        Called with the layout and a folder; returns the set in the folder, or None if it has another layout.
    """

    key: str
    title: str
    origin: str
    find: Callable[[Layout, Path], FolderSet | None] = field(repr=False)

    def __call__(self, folder: Path) -> FolderSet | None:
        """Return the set in a folder if the folder has this layout."""
        return self.find(self, folder)


@dataclass(frozen=True)
class FirstVertices:
    """The map is the identity onto the first `n` vertices of every shape."""

    n: int


@dataclass(frozen=True)
class SameFaces:
    """The map is the identity, provided that the shape has the triangles that the shapes of the set share."""


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
    """A file of the published set that the folder lacks: its path relative to the root, and where to get it."""

    path: str
    origin: str


@dataclass(frozen=True, eq=False)
class FolderSet:
    """A recognised set of shapes; a mesh or map is read when it is asked for.

    Parameters
    ----------
    name
        What results call the set: "FAUST_6890", "SCAPE_5000", or the folder's name for a plain folder.
    layout
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
        Files of the published set that this folder lacks.
    extras
        Files with pairs and lists, which are copied with the shapes.
    """

    name: str
    layout: Layout
    root: Path
    entries: tuple[Entry, ...]
    pairs: tuple[tuple[str, str], ...] = ()
    lists: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    missing: tuple[Missing, ...] = ()
    extras: tuple[Path, ...] = ()

    def __repr__(self) -> str:
        return f"FolderSet({self.name!r}, {counted(len(self.entries), 'shape')}, {str(self.root)!r})"

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all shapes, in natural order."""
        return tuple(entry.name for entry in self.entries)

    @property
    def mapped(self) -> tuple[str, ...]:
        """Names of the shapes whose correspondence is known, in natural order."""
        return tuple(self.templates)

    @property
    def templates(self) -> dict[str, str]:
        """Name -> template of the shapes whose correspondence is known."""
        return {entry.name: entry.template for entry in self.entries if entry.truth is not None}

    @property
    def mapped_pairs(self) -> tuple[tuple[str, str], ...]:
        """Those of `pairs` whose two shapes have maps from one template: the pairs that can be evaluated."""
        known = self.templates
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
                f"{self.root}: there is no shape {name!r} among the {len(self.entries)} of this {self.layout.title} "
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
    def _shared(self) -> Mesh:
        return shared_mesh(partial(read_mesh, entry.mesh, entry.name) for entry in self.entries)

    def _truth(self, entry: Entry, mesh: Mesh) -> PointMap:
        if isinstance(entry.truth, Path):
            return _read_map(entry.truth, mesh)
        if isinstance(entry.truth, FirstVertices):
            return self._identity(entry.truth.n, mesh)
        if isinstance(entry.truth, SameFaces) and same_connectivity(mesh, self._shared):
            return self._identity(mesh.n_vertices, mesh)
        why = f"its triangles differ from those of {self._shared.name}" if entry.truth else "its map is missing"
        raise DataError(
            f"{entry.mesh}: the correspondence of this shape is not known: {why}; "
            f"wanted a file corres/{entry.name}.vts (line i: the vertex, counted from 1, that is template point i)"
        )

    def _identity(self, n: int, mesh: Mesh) -> PointMap:
        if mesh.n_vertices < n:
            raise DataError(
                f"{self.entry(mesh.name).mesh}: has {counted(mesh.n_vertices, 'vertex')}, but in a {self.layout.title} "
                f"folder the first {n} are the template's; is it a remeshed or decimated copy?"
            )
        return PointMap.identity(n, mesh.n_vertices, mesh.name)


def _read_map(path: Path, mesh: Mesh) -> PointMap:
    return read_labels(path, direction=Direction.TEMPLATE_TO_SHAPE, base=1, n_to=mesh.n_vertices)


def stems(files: Sequence[Path]) -> dict[str, Path]:
    """Index files by name without suffix, in order.

    Raises
    ------
    DataError
        If two files have one name.
    """
    found: dict[str, Path] = {}
    for path in files:
        if path.stem in found:
            raise DataError(f"{path} and {found[path.stem].name} have one name, so it is not clear which is the shape")
        found[path.stem] = path
    return found


def exists(path: Path) -> bool:
    """Tell whether a folder has this file; the listing of the folder is read once and kept."""
    return path in list_files(path.parent, path.suffix)


def listed_pairs(folder: Path) -> tuple[tuple[tuple[str, str], ...], tuple[Path, ...]]:
    """Return the pairs that `test_pairs.txt` lists and, as the only extra, the file; both empty if there is no file."""
    path = folder / PAIRS
    return (tuple(read_pairs(path)), (path,)) if exists(path) else ((), ())


def absent(
    wanted: Iterable[str], found: Mapping[str, Path], place: Path, suffix: str, origin: str
) -> tuple[Missing, ...]:
    """Return the names without a file, as missing files of this suffix in `place`."""
    return tuple(Missing((place / (name + suffix)).as_posix(), origin) for name in wanted if name not in found)


def absent_files(paths: Iterable[Path], root: Path, origin: str) -> tuple[Missing, ...]:
    """Return which of some files are missing."""
    return tuple(Missing(path.relative_to(root).as_posix(), origin) for path in paths if not exists(path))


def remeshed_set(
    layout: Layout, folder: Path, name: str, template_of: Callable[[str], str], published: Sequence[str] = ()
) -> FolderSet | None:
    """Return a set in the layout of SGA18: `vtx_5k/NAME.off`, `vtx_5k/corres/NAME.vts`, `NAME.sym.vts`, test pairs.

    Parameters
    ----------
    layout, folder
        The layout, and the folder that may hold the set (or its `vtx_5k`).
    name
        What results call the set.
    template_of
        Name of a shape -> name of its template, for sets with several.
    published
        Names of all shapes as published, if they are known.
    """
    if folder.resolve().name == "vtx_5k":
        folder = folder.resolve().parent
    meshes = stems(list_files(folder / "vtx_5k", ".off"))
    if not meshes:
        return None
    maps = stems(list_files(folder / "vtx_5k/corres", ".vts"))
    entries = tuple(
        Entry(stem, path, maps.get(stem), maps.get(f"{stem}.sym"), template_of(stem)) for stem, path in meshes.items()
    )
    pairs, extras = listed_pairs(folder)
    wanted = list(dict.fromkeys([*meshes, *published, *(stem for pair in pairs for stem in pair)]))
    missing = absent(wanted, meshes, Path("vtx_5k"), ".off", layout.origin)
    both = [s for stem in wanted for s in (stem, f"{stem}.sym")]
    missing += absent(both, maps, Path("vtx_5k/corres"), ".vts", layout.origin)
    missing += absent_files([folder / PAIRS], folder, layout.origin)
    return FolderSet(name, layout, folder, entries, pairs, missing=missing, extras=extras)
