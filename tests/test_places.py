from __future__ import annotations

import ast
from importlib import import_module
from pathlib import Path

import pytest

import csm
from csm._places import Loaded, lazily, load

ROOT = Path(csm.__file__).parent
LAZY = [path for path in sorted(ROOT.rglob("__init__.py")) if "lazily(" in path.read_text(encoding="utf-8")]

FORMER_NAMES = {("csm", "match_meshes")}
"""Names of earlier releases, which are there and not listed, with their packages."""


def package_of(path: Path) -> str:
    return ".".join(["csm", *path.parent.relative_to(ROOT).parts])


def names_for_type_checkers(path: Path) -> set[str]:
    """Return what a package imports under ``if TYPE_CHECKING:``."""
    branches = [node for node in ast.parse(path.read_text(encoding="utf-8")).body if isinstance(node, ast.If)]
    known = next(node for node in branches if isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING")
    return {alias.asname or alias.name for node in known.body for alias in node.names}


def test_a_place_is_a_module_and_a_name_in_it():
    assert load("csm.descriptors.acd:ACD.paper")().order == 6


@pytest.mark.parametrize(("place", "error"), [("csm.nothing:x", ImportError), ("csm.errors:Nothing", AttributeError)])
def test_a_wrong_place_says_what_is_missing(place, error):
    with pytest.raises(error, match=r"[Nn]othing"):
        load(place)


@pytest.mark.parametrize("path", LAZY, ids=package_of)
def test_a_lazy_package_has_the_names_that_it_lists_and_that_type_checkers_know(path):
    package = import_module(package_of(path))
    listed = {name for name in names_for_type_checkers(path) if (package.__name__, name) not in FORMER_NAMES}
    assert set(package.__all__) == listed
    assert [name for name in dir(package) if not name.startswith("__")] == sorted(package.__all__)
    assert all(getattr(package, name) is not None for name in names_for_type_checkers(path))
    with pytest.raises(AttributeError, match=f"module '{package.__name__}' has no attribute 'nothing'"):
        _ = package.nothing


def test_the_rooms_that_commands_begin_with_are_lazy():
    assert {"csm", "csm.mesh", "csm.descriptors", "csm.networks", "csm.matching"} <= {*map(package_of, LAZY)}


def test_a_lazy_package_imports_a_module_for_its_name_only():
    find, names = lazily("csm", {"csm.errors": ("MeshError",), "csm.nowhere": ("Other",)})
    assert find("MeshError") is load("csm.errors:MeshError")
    assert {"__version__", "match"} <= {*names()}
    with pytest.raises(ImportError, match="nowhere"):
        find("Other")


def test_a_registry_makes_each_object_once_and_when_it_is_asked_for():
    made = []
    found = Loaded({name: lambda name=name: made.append(name) or [name] for name in "abc"})
    assert (list(found), len(found), "b" in found, "x" in found, made) == (["a", "b", "c"], 3, True, False, [])
    assert found["b"] is found["b"]
    assert made == ["b"]
    with pytest.raises(KeyError):
        found["x"]
    assert found.get("x") is None


def test_a_registry_takes_additions_and_gives_them_back():
    found = Loaded({"a": lambda: 1})
    found["b"] = 2
    assert dict(found) == {"a": 1, "b": 2}
    del found["a"], found["b"]
    assert dict(found) == {}
    assert repr(Loaded({"a": lambda: 1, "b": lambda: 2})) == "Loaded(a, b)"
