"""How csm is laid out: which room may import what, how long things may be, and that every module has its tests."""

from __future__ import annotations

import ast
import functools
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
TESTS = ROOT / "tests"
MODULES = sorted((ROOT / "csm").rglob("*.py"))
SOURCES = [*MODULES, *(p for d in ("tests", "data_prep", "benchmarks") for p in sorted((ROOT / d).rglob("*.py")))]

ROOMS = {
    "mesh": set(),
    "operators": {"mesh"},
    "descriptors": {"mesh", "operators"},
    "data": {"mesh", "operators", "descriptors"},
    "networks": set(),
    "learning": {"mesh", "operators", "descriptors", "data", "networks"},
    "matching": {"mesh", "operators", "descriptors", "data", "learning"},
    "evaluation": {"mesh", "operators", "descriptors", "data", "matching"},
    "viewer": {"mesh", "matching", "evaluation"},
    "experiments": {"mesh", "operators", "descriptors", "data", "learning", "matching", "evaluation", "viewer"},
}
ROOMS["reproduction"] = {*ROOMS}
ROOMS["commands"] = {*ROOMS}
"""The rooms of csm, each with those it may import besides itself; left to right, never back."""

CONFIGURATION = {"hydra", "omegaconf"}
LEARNING = {"torch", "lightning", "tensorboard", "torchmetrics"}
FORBIDDEN = {
    "mesh": CONFIGURATION | LEARNING,
    "operators": CONFIGURATION | LEARNING,
    "descriptors": CONFIGURATION | LEARNING,
    "data": CONFIGURATION | LEARNING,
    "learning": CONFIGURATION,
    "matching": CONFIGURATION | {"lightning"},
    "evaluation": CONFIGURATION | {"lightning"},
    "viewer": CONFIGURATION | LEARNING,
    "experiments": CONFIGURATION,
    "reproduction": CONFIGURATION | {"lightning"},
}
"""Libraries that a room does without."""

DISKLESS = ("operators", "descriptors", "networks")
DISK_CALLS = {"open", "read_text", "read_bytes", "write_text", "write_bytes", "savez", "savetxt", "loadtxt", "mkdir"}

LONGEST_FILE = 300
LONGEST_FUNCTION = 60

PICKLERS = {"pickle", "dill", "joblib", "cloudpickle", "shelve"}
SAFE_VALUES = {"allow_pickle": False, "weights_only": True}

TESTED_ELSEWHERE = {
    "commands.clean": "commands/test_app.py",
    "commands.describe": "commands/test_pipeline.py",
    "commands.evaluate": "commands/test_pipeline.py",
    "commands.groups": "test_configs.py",
    "commands.main": "test_cli.py",
    "commands.match": "commands/test_pipeline.py",
    "commands.matrix": "commands/test_pipeline.py",
    "commands.tested": "commands/test_pipeline.py",
    "commands.train": "commands/test_training.py",
    "errors": "mesh/io/test_files.py",
    "mesh.io.raw": "mesh/io/test_off.py",
}
"""Modules without a test file of their own, with the one that tests them through what uses them."""

OF_SEVERAL_MODULES = {"commands.matrices", "commands.pipeline", "descriptors.invariants", "viewer.browser"}
"""Test files without a module of their own, besides those of the whole, which lie directly in tests/."""


def name_of(path: Path) -> str:
    """Return the dotted name below csm, such as "mesh.shape"; empty for csm itself."""
    return ".".join(path.relative_to(ROOT / "csm").with_suffix("").parts).removesuffix("__init__").removesuffix(".")


def room_of(path: Path) -> str:
    return name_of(path).partition(".")[0]


@functools.cache
def tree_of(path: Path) -> ast.Module:
    return ast.parse(path.read_text(), filename=str(path))


def imports(path: Path) -> Iterator[str]:
    """Yield the dotted name of everything a file imports, also inside functions; ``from a import b`` gives "a.b"."""
    for node in ast.walk(tree_of(path)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path.relative_to(ROOT)}:{node.lineno}: imports are written in full"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def of_room(room: str) -> list[Path]:
    return [path for path in MODULES if room_of(path) == room]


def test_every_folder_of_csm_is_a_known_room():
    assert {p.name for p in (ROOT / "csm").iterdir() if (p / "__init__.py").is_file()} == set(ROOMS)


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_imports_only_rooms_before_it(room):
    allowed = {room, *ROOMS[room]}
    wrong = [
        f"{path.relative_to(ROOT)} imports {name}"
        for path in of_room(room)
        for name in imports(path)
        if name.startswith("csm.") and name.split(".")[1] in ROOMS and name.split(".")[1] not in allowed
    ]
    assert wrong == []


def test_imports_of_rooms_have_no_cycle():
    order = list(ROOMS)
    assert all(order.index(other) < order.index(room) for room in order for other in ROOMS[room])


@pytest.mark.parametrize("page", ["README.md", "CONTRIBUTING.md"])
def test_pages_draw_the_order_of_the_rooms(page):
    assert " → ".join(ROOMS) in " ".join((ROOT / page).read_text().split())


@pytest.mark.parametrize("room", FORBIDDEN)
def test_a_room_does_without_some_libraries(room):
    wrong = [
        f"{path.relative_to(ROOT)} imports {name}"
        for path in of_room(room)
        for name in imports(path)
        if name.partition(".")[0] in FORBIDDEN[room]
    ]
    assert wrong == []


def test_networks_import_torch_only():
    known = {"torch", "csm", *sys.stdlib_module_names}
    wrong = [
        f"{p.relative_to(ROOT)}: {n}" for p in of_room("networks") for n in imports(p) if n.split(".")[0] not in known
    ]
    assert wrong == []


@pytest.mark.parametrize("room", DISKLESS)
def test_the_disk_is_left_to_readers_and_writers(room):
    wrong = []
    for path in of_room(room):
        for node in ast.walk(tree_of(path)):
            if isinstance(node, ast.Call):
                called = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
                if called in DISK_CALLS:
                    wrong.append(f"{path.relative_to(ROOT)}:{node.lineno} calls {called}")
    assert wrong == []


def test_every_module_says_what_it_is():
    assert [name_of(path) for path in MODULES if not ast.get_docstring(tree_of(path))] == []


def test_files_are_short():
    lengths = {str(path.relative_to(ROOT)): len(path.read_text().splitlines()) for path in SOURCES}
    assert {name: length for name, length in lengths.items() if length > LONGEST_FILE} == {}


def test_functions_are_short():
    long = [
        f"{path.relative_to(ROOT)}:{node.lineno} {node.name}"
        for path in SOURCES
        for node in ast.walk(tree_of(path))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        and (node.end_lineno or 0) - node.lineno >= LONGEST_FUNCTION
    ]
    assert long == []


def test_nothing_is_pickled():
    """A pickle runs code when it is read, so csm neither reads nor writes one."""
    wrong = []
    for path in MODULES:
        where = path.relative_to(ROOT)
        wrong += [f"{where} imports {name}" for name in imports(path) if name.partition(".")[0] in PICKLERS]
        for node in ast.walk(tree_of(path)):
            if isinstance(node, ast.keyword) and node.arg in SAFE_VALUES:
                value = ast.literal_eval(node.value) if isinstance(node.value, ast.Constant) else "computed"
                if value is not SAFE_VALUES[node.arg]:
                    wrong.append(f"{where}:{node.value.lineno} has {node.arg}={value}")
    assert wrong == []


def test_every_public_module_has_its_tests():
    public = [path for path in MODULES if not path.name.startswith("_")]
    mirrors = {name_of(path): path.relative_to(ROOT / "csm").with_name(f"test_{path.name}") for path in public}
    assert sorted(n for n, file in mirrors.items() if not (TESTS / file).is_file()) == sorted(TESTED_ELSEWHERE)
    assert [file for file in TESTED_ELSEWHERE.values() if not (TESTS / file).is_file()] == []


def test_every_test_file_has_its_module():
    known = {name_of(path) for path in MODULES} | OF_SEVERAL_MODULES
    for room in ROOMS:
        for path in (TESTS / room).rglob("test_*.py"):
            mirrored = path.relative_to(TESTS).with_name(path.name.removeprefix("test_"))
            assert ".".join(mirrored.with_suffix("").parts) in known, f"{path.relative_to(ROOT)} mirrors nothing"
