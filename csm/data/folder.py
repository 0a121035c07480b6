"""Recognise the layouts in which data sets are published, and say what of them is missing and where to get it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path

from csm.data.folderset import Entry, FirstVertices, FolderSet, Missing, SameFaces
from csm.data.kinds import (
    ACD_FAUST,
    ACD_SCAPE,
    FAUST_NAMES,
    KINDS,
    LPS,
    LPS_SIZES,
    MPI_FAUST,
    N_FAUST,
    PLAIN,
    SCAPE_NAMES,
    SGA18_FAUST,
    SGA18_TOSCA,
    SHREC19,
    SHREC19_NAMES,
)
from csm.errors import DataError, MeshError
from csm.mesh.io import count_vertices, list_files, list_folders, read_names, read_pairs

_PAIRS = "test_pairs"


def recognise(folder: str | Path) -> FolderSet:
    """Find out which published layout a folder has; only names, lists and one mesh header are read.

    Raises
    ------
    DataError
        If there are no meshes; the message names sub-folders that would be recognised, or the known layouts.
    """
    root = Path(folder)
    found = _published(root) or _plain(root)
    if found:
        return found
    below = [str(s.root) for s in find_sets(root, depth=2)]
    if below:
        raise DataError(f"{root}: this is no set itself; did you mean {', '.join(below[:10])}?")
    kinds = ", ".join(kind.title for kind in KINDS)
    raise DataError(f"{root}: there are no meshes that csm can read; wanted one of: {kinds}")


def find_sets(folder: Path, depth: int = 4) -> list[FolderSet]:
    """Return the published sets in a folder and below it, as an unpacked archive or repository holds them.

    A folder inside a recognised one is not looked at again, and plain folders do not count.
    """
    found: list[FolderSet] = []
    for path in [folder, *list_folders(folder, depth)]:
        if not any(path.is_relative_to(s.root) for s in found):
            match = _published(path)
            found += [match] if match else []
    return found


def _published(folder: Path) -> FolderSet | None:
    layouts: list[Callable[[Path], FolderSet | None]] = [_mpi_faust, _acd_release, _sga18, _shrec19, _lps]
    return next((found for layout in layouts if (found := layout(folder))), None)


def _mpi_faust(folder: Path) -> FolderSet | None:
    """`training/registrations/tr_reg_000.ply` to `099.ply`, seen from any folder above or from `registrations`."""
    inner = Path("training/registrations")
    for place in (folder / "MPI-FAUST" / inner, folder / inner, folder / "registrations", folder):
        meshes = _stems(list_files(place, ".ply"))
        if meshes and set(meshes) <= set(FAUST_NAMES):
            break
    else:
        if not list_files(folder / "training/scans", ".ply"):
            return None
        place, meshes = folder / inner, {}  # the scans alone were unpacked: a known set of which all is missing
    entries = tuple(Entry(name, path, FirstVertices(N_FAUST)) for name, path in meshes.items())
    missing = _absent(FAUST_NAMES, meshes, place.relative_to(folder), ".ply", MPI_FAUST.origin)
    return FolderSet("FAUST_MPI", MPI_FAUST, folder, entries, missing=missing)


def _acd_release(folder: Path) -> FolderSet | None:
    """`shapes/NAME.mat` with `labels/NAME.mat`: FAUST (tr_reg_...) or SCAPE (mesh...)."""
    meshes, labels = _stems(list_files(folder / "shapes", ".mat")), _stems(list_files(folder / "labels", ".mat"))
    if meshes and set(meshes) <= set(FAUST_NAMES):
        kind, name, wanted = ACD_FAUST, "FAUST_6890", FAUST_NAMES
    elif meshes and set(meshes) <= set(SCAPE_NAMES):
        kind, name, wanted = ACD_SCAPE, "SCAPE_5000", SCAPE_NAMES
    else:
        return None
    missing = _absent(wanted, meshes, Path("shapes"), ".mat", kind.origin)
    missing += _absent(wanted, labels, Path("labels"), ".mat", kind.origin)
    files = {part: folder / f"files_{part}.txt" for part in ("train", "test")}
    if kind is ACD_SCAPE:
        missing += _absent_files(files.values(), folder, kind.origin)
    present = {part: path for part, path in files.items() if _exists(path)}
    lists = {part: tuple(read_names(path)) for part, path in present.items()}
    entries = tuple(Entry(stem, path, labels.get(stem)) for stem, path in meshes.items())
    return FolderSet(name, kind, folder, entries, lists=lists, missing=missing, extras=tuple(present.values()))


def _lps(folder: Path) -> FolderSet | None:
    """`tr_reg_000.off` to `099.off` with 8000, 10000, 12000 or 15000 vertices, the first 6890 of them FAUST's."""
    meshes = _stems(list_files(folder, ".off"))
    if not meshes or not set(meshes) <= set(FAUST_NAMES) or list_files(folder / "corres", ".vts"):
        return None
    try:
        n = count_vertices(next(iter(meshes.values())))
    except MeshError:
        return None  # the plain layout's reader will say what is wrong with the file
    if n not in LPS_SIZES:
        return None
    entries = tuple(Entry(stem, path, FirstVertices(N_FAUST)) for stem, path in meshes.items())
    missing = _absent(FAUST_NAMES, meshes, Path(), ".off", LPS.origin)
    return FolderSet(f"FAUST_{n}", LPS, folder, entries, missing=missing)


def _sga18(folder: Path) -> FolderSet | None:
    """`vtx_5k/NAME.off`, `vtx_5k/corres/NAME.vts` and `NAME.sym.vts`, `test_pairs.txt`."""
    if folder.resolve().name == "vtx_5k":
        folder = folder.resolve().parent
    meshes = _stems(list_files(folder / "vtx_5k", ".off"))
    if not meshes:
        return None
    faust = set(meshes) <= set(FAUST_NAMES)
    kind, name = (SGA18_FAUST, "FAUST_5k_remeshed") if faust else (SGA18_TOSCA, "TOSCA_5k_remeshed")
    maps = _stems(list_files(folder / "vtx_5k/corres", ".vts"))
    entries = tuple(
        Entry(stem, path, maps.get(stem), maps.get(f"{stem}.sym"), "" if faust else stem.rstrip("0123456789"))
        for stem, path in meshes.items()
    )
    pairs, extras = _pairs(folder)
    named = [stem for pair in pairs for stem in pair]
    wanted = list(dict.fromkeys([*meshes, *(FAUST_NAMES if faust else ()), *named]))
    missing = _absent(wanted, meshes, Path("vtx_5k"), ".off", kind.origin)
    missing += _absent(
        [s for stem in wanted for s in (stem, f"{stem}.sym")], maps, Path("vtx_5k/corres"), ".vts", kind.origin
    )
    missing += _absent_files([folder / f"{_PAIRS}.txt"], folder, kind.origin)
    return FolderSet(name, kind, folder, entries, pairs, missing=missing, extras=extras)


def _shrec19(folder: Path) -> FolderSet | None:
    """`1.obj` to `44.obj`, `test_pairs.txt`, and maps onto FAUST's template in `derived_smpl_vts` or `corres`."""
    meshes = _stems(list_files(folder, ".obj") or list_files(folder, ".off"))
    pairs, extras = _pairs(folder)
    if not meshes or not set(meshes) <= set(SHREC19_NAMES) or not (pairs or len(meshes) == len(SHREC19_NAMES)):
        return None
    place = next((p for p in ("derived_smpl_vts", "corres") if list_files(folder / p, ".vts")), "corres")
    maps = _stems(list_files(folder / place, ".vts"))
    entries = tuple(Entry(stem, path, maps.get(stem)) for stem, path in meshes.items())
    missing = _absent(SHREC19_NAMES, meshes, Path(), ".obj", SHREC19.origin)
    missing += _absent(SHREC19_NAMES, maps, Path(place), ".vts", SHREC19.origin)
    missing += _absent_files([folder / f"{_PAIRS}.txt"], folder, SHREC19.origin)
    return FolderSet("SHREC19_5k_remeshed", SHREC19, folder, entries, pairs, missing=missing, extras=extras)


def _plain(folder: Path) -> FolderSet | None:
    """Meshes in the folder or in its `off`, with `corres/NAME.vts`, or else one connectivity for all."""
    geometry, arrays = (".off", ".ply", ".obj", ".stl"), (".npz", ".mat")
    places = [(folder, geometry), (folder / "off", geometry), (folder, arrays)]
    meshes = next((files for place, suffixes in places if (files := list_files(place, *suffixes))), [])
    if not meshes:
        return None
    stems = _stems(meshes)
    maps = _stems(list_files(folder / "corres", ".vts"))
    entries = tuple(
        Entry(stem, path, maps.get(stem) if maps else SameFaces(), maps.get(f"{stem}.sym"))
        for stem, path in stems.items()
    )
    pairs, extras = _pairs(folder)
    named = dict.fromkeys(stem for pair in pairs for stem in pair)
    missing = tuple(Missing(stem, f"named in {_PAIRS}.txt") for stem in named if stem not in stems)
    missing += _absent(stems, maps, Path("corres"), ".vts", PLAIN.origin) if maps else ()
    return FolderSet(folder.resolve().name, PLAIN, folder, entries, pairs, missing=missing, extras=extras)


def _stems(files: Sequence[Path]) -> dict[str, Path]:
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


def _exists(path: Path) -> bool:
    return path in list_files(path.parent, path.suffix)


def _pairs(folder: Path) -> tuple[tuple[tuple[str, str], ...], tuple[Path, ...]]:
    path = folder / f"{_PAIRS}.txt"
    return (tuple(read_pairs(path)), (path,)) if _exists(path) else ((), ())


def _absent(
    wanted: Iterable[str], found: Mapping[str, Path], place: Path, suffix: str, origin: str
) -> tuple[Missing, ...]:
    return tuple(Missing((place / (name + suffix)).as_posix(), origin) for name in wanted if name not in found)


def _absent_files(paths: Iterable[Path], root: Path, origin: str) -> tuple[Missing, ...]:
    return tuple(Missing(path.relative_to(root).as_posix(), origin) for path in paths if not _exists(path))
