"""Inspect all shapes of a set, or of the split of a data module: what cannot be used is found before any work."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

from csm._counts import counted
from csm._progress import progress_bar
from csm.data.base import DataModule
from csm.data.folders import FolderSet
from csm.data.shapes import Shape, ShapeSet, templates_of
from csm.errors import CsmError, DataError
from csm.mesh.check import Finding, Severity, check
from csm.mesh.shape import Mesh

NOT_EXACT = ("non_manifold_edges", "non_manifold_vertices")
"""Findings with which exact geodesic distances cannot be measured."""


@dataclass(frozen=True)
class Inspected:
    """What was found about one shape.

    Parameters
    ----------
    name
        Name of the shape.
    n_vertices, n_faces, area
        Sizes; the area in squared units of the file.  Zero if the mesh cannot be read.
    findings
        Of `csm.mesh.check.check`.
    problems
        Why the mesh or its map cannot be read or used.
    n_truth
        Number of template points that its map tells of; None if it has no map.
    """

    name: str
    n_vertices: int = 0
    n_faces: int = 0
    area: float = 0.0
    findings: tuple[Finding, ...] = ()
    problems: tuple[str, ...] = ()
    n_truth: int | None = None

    @property
    def usable(self) -> bool:
        """Whether operators can be built on the shape and its map, if it has one, can be used."""
        return not self.problems and all(finding.severity == "note" for finding in self.findings)


@dataclass(frozen=True)
class Problem:
    """One thing that a training or a test on a data module would meet.

    Parameters
    ----------
    set, shape
        Their names; the shape is empty where it is about the set.
    file
        The file of the shape, if it has one.
    kind
        "unreadable" (mesh or map, also maps of different length), the kind of a finding of `csm.mesh.check`,
        "not_exact" (exact geodesic distances cannot be measured), "too_small" (fewer vertices than eigenpairs),
        "missing" (shapes of the split) or "no_pairs".
    severity
        "error" if training or testing fails with it; "note" if that depends on what is asked for.
    text
        One sentence; `str` puts the file or the set before it.
    """

    set: str
    shape: str
    file: str
    kind: str
    severity: Severity
    text: str

    def __str__(self) -> str:
        if self.kind in ("unreadable", "missing"):
            return self.text  # it names the file or the set, as the error did
        return f"{self.file or '/'.join(filter(None, (self.set, self.shape)))}: {self.text}"


def inspect(shapes: FolderSet, progress: bool = True) -> tuple[Inspected, ...]:
    """Read and check every shape of a set, one after the other; nothing is raised for a bad one."""
    with progress_bar(shapes.names, desc=f"check {shapes.name}", unit="shape", disable=not progress) as bar:
        rows = []
        for name in bar:
            bar.set_postfix_str(name, refresh=False)
            rows.append(_inspect_one(shapes, name))
    return _of_one_length(rows, shapes, shapes.templates)


def data_problems(
    data: DataModule, *, train: bool = True, test: bool = True, progress: bool = True
) -> tuple[Problem, ...]:
    """Read every shape that a data module trains and tests on, and return what would fail; nothing is raised for it.

    The training shapes stay in memory, as they do for the training.

    Parameters
    ----------
    data
        The data module.
    train, test
        Look at the training shapes; at the test shapes, and whether the split leaves a pair of them in every test set.
    progress
        Show a progress bar with the shape's name.
    """
    wanted = max(data.recipe.basis_k, data.recipe.descriptor.eigenpairs)
    found = _part_problems(data.train_set, data.train_names, data.shape, wanted, progress) if train else []
    for shapes in data.test_sets.values() if test else ():
        names = partial(data.test_names, shapes)
        found += _part_problems(shapes, names, shapes.load, wanted, progress)
        found += _pair_problems(shapes, data)
    return tuple(found)


def require_sound(
    data: DataModule, *, train: bool = True, test: bool = True, exact: bool = False, progress: bool = True
) -> None:
    """Raise what `data_problems` finds, so that an experiment fails before its expensive part and not after it.

    Parameters
    ----------
    data, train, test, progress
        As of `data_problems`.
    exact
        The test measures exact geodesic distances, which it cannot on every mesh.

    Raises
    ------
    DataError
        If there is an error; lists the first ten.
    """
    problems = data_problems(data, train=train, test=test, progress=progress)
    wrong = [p for p in problems if p.severity == "error" or (exact and test and p.kind == "not_exact")]
    if wrong:
        more = [f"... and {len(wrong) - 10} more"] if len(wrong) > 10 else []
        raise DataError("\n".join(["the data cannot be used as asked:", *map(str, wrong[:10]), *more]))


def _inspect_one(shapes: FolderSet, name: str) -> Inspected:
    try:
        mesh = shapes.mesh(name)
    except CsmError as error:
        return Inspected(name, problems=(str(error),))
    seen = _seen(name, mesh)
    if shapes.entry(name).truth is None:
        return seen  # `FolderSet.missing` names it
    try:
        return replace(seen, n_truth=shapes.with_maps(name, mesh).truth.n_from)
    except CsmError as error:
        return replace(seen, problems=(str(error),))


def _seen(name: str, mesh: Mesh, n_truth: int | None = None) -> Inspected:
    return Inspected(name, mesh.n_vertices, mesh.n_faces, mesh.area, check(mesh), n_truth=n_truth)


def _of_one_length(rows: Sequence[Inspected], shapes: ShapeSet, templates: Mapping[str, str]) -> tuple[Inspected, ...]:
    """Add a problem to the rows whose map has another length than most maps of the same template."""
    lengths: dict[str, Counter[int]] = {}
    for row in rows:
        if row.n_truth is not None:
            lengths.setdefault(templates.get(row.name, ""), Counter())[row.n_truth] += 1
    usual = {template: counter.most_common(1)[0][0] for template, counter in lengths.items()}
    out = []
    for row in rows:
        wanted = usual.get(templates.get(row.name, ""))
        if row.n_truth not in (None, wanted):
            why = (
                f"{_map_file(shapes, row.name)}: tells of {row.n_truth} template points, but the other maps of "
                f"{shapes.name} of {wanted}; a map has one line for each, so is it cut off?"
            )
            row = replace(row, problems=(*row.problems, why))
        out.append(row)
    return tuple(out)


def _map_file(shapes: ShapeSet, name: str) -> str:
    truth = shapes.entry(name).truth if isinstance(shapes, FolderSet) else None
    return str(truth) if hasattr(truth, "suffix") else _mesh_file(shapes, name) or f"{shapes.name}/{name}"


def _mesh_file(shapes: ShapeSet, name: str) -> str:
    inner = getattr(shapes, "shapes", shapes)  # of a set that is cleaned when it is read
    return str(inner.entry(name).mesh) if isinstance(inner, FolderSet) else ""


def _part_problems(
    shapes: ShapeSet,
    names: Callable[[], Iterable[str]],
    load: Callable[[str], Shape],
    eigenpairs: int,
    progress: bool,
) -> list[Problem]:
    try:
        wanted = list(names())
    except CsmError as error:
        return [Problem(shapes.name, "", "", "missing", "error", str(error))]
    if getattr(shapes, "built_in", False):  # made by csm: one tells of all, and to make finer ones takes its time
        wanted, progress = wanted[:1], False
    with progress_bar(wanted, desc=f"check {shapes.name}", unit="shape", disable=not progress) as bar:
        rows = []
        for name in bar:
            bar.set_postfix_str(name, refresh=False)
            rows.append(_loaded(load, name))
    rows = list(_of_one_length(rows, shapes, templates_of(shapes)))
    return [problem for row in rows for problem in _row_problems(shapes, row, eigenpairs)]


def _loaded(load: Callable[[str], Shape], name: str) -> Inspected:
    try:
        shape = load(name)
    except CsmError as error:
        return Inspected(name, problems=(str(error),))
    return _seen(name, shape.mesh, shape.truth.n_from)


def _row_problems(shapes: ShapeSet, row: Inspected, eigenpairs: int = 0) -> list[Problem]:
    file = _mesh_file(shapes, row.name)
    found = [Problem(shapes.name, row.name, file, "unreadable", "error", text) for text in row.problems]
    if 0 < row.n_vertices < eigenpairs:
        text = (
            f"has {counted(row.n_vertices, 'vertex')}, but {eigenpairs} eigenpairs are asked for (data.basis_k, "
            "descriptor.k); a mesh has as many as it has vertices"
        )
        found.append(Problem(shapes.name, row.name, file, "too_small", "error", text))
    for finding in row.findings:
        if finding.severity == "error":
            found.append(Problem(shapes.name, row.name, file, finding.kind, "error", finding.text))
        elif finding.kind in NOT_EXACT:
            text = (
                f"{finding.text}; exact geodesic distances cannot be measured on such a mesh, but those by the heat "
                "method and along edges can"
            )
            found.append(Problem(shapes.name, row.name, file, "not_exact", "note", text))
    return found


def _pair_problems(shapes: ShapeSet, data: DataModule) -> list[Problem]:
    templates = templates_of(shapes)
    tested = Counter(templates[name] for name in data.split.test if name in templates)
    if max(tested.values(), default=0) > 1:
        return []
    text = (
        f"split {data.split.name} leaves {counted(tested.total(), 'test shape')} with known correspondence, and no two "
        "that make a pair to be tested; wanted two or more (such as data.n_test=2), or no test (test=false)"
    )
    return [Problem(shapes.name, "", "", "no_pairs", "error", text)]
